"""Prints Table 1 of Vakulenko et al. 2017:  python -m benchmarks table1 FOLDER_WITH_86_01.amc [--json]."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict
from pathlib import Path

from benchmarks.papers.centralized_table1 import centralized_table1
from controller.mocap.formats.reading import read_clip


def main(folder: str, *options: str) -> None:
    start = time.perf_counter()
    clip = read_clip(Path(folder) / "86_01.amc")
    entries = []
    print("n     m  segment   paper   its method  (mm)    learned   (mm)", file=sys.stderr)
    for e in centralized_table1(clip):
        entries.append(asdict(e))
        print(
            f"{e.centers} {e.satellites:5d} {e.segment:5d} {e.paper:11.4f} {e.fixed:10.4f} {e.fixed_mm:7.2f} "
            f"{e.learned:10.4f} {e.learned_mm:7.2f}",
            file=sys.stderr if options else sys.stdout,
            flush=True,
        )
    if "--json" in options:
        print(json.dumps(entries))
    print(f"{time.perf_counter() - start:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(*sys.argv[1:])
