"""python -m benchmarks NAME [ARGUMENTS]: runs one of the benchmarks in these folders; without a name it lists them."""

from __future__ import annotations

import ast
import runpy
import sys
from pathlib import Path

from motiondeck_base.errors import MotiondeckError

FOLDER = Path(__file__).parent


def find_benchmarks() -> dict[str, Path]:
    """The files that can be run, by name; the other files are parts of these."""
    files = sorted(FOLDER.glob("*/*.py"))
    return {file.stem: file for file in files if '__name__ == "__main__"' in file.read_text()}


def first_line(file: Path) -> str:
    """What a benchmark measures: the first line of its docstring."""
    return (ast.get_docstring(ast.parse(file.read_text())) or "").partition("\n")[0]


def main() -> int:
    found = find_benchmarks()
    if len(sys.argv) < 2 or sys.argv[1] not in found:
        print("python -m benchmarks NAME [ARGUMENTS]; NAME --help lists the arguments")
        for room in sorted({file.parent.name for file in found.values()}):
            print(f"\n{room}:")
            for name, file in found.items():
                if file.parent.name == room:
                    print(f"  {name:<22} {first_line(file)}")
        return 0 if len(sys.argv) < 2 else 2
    del sys.argv[0]
    file = found[sys.argv[0]]
    try:
        runpy.run_module(f"benchmarks.{file.parent.name}.{file.stem}", run_name="__main__", alter_sys=True)
    except MotiondeckError as error:
        print(f"benchmarks {sys.argv[0]}: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
