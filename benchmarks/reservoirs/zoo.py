"""How many of a folder's recordings are read, learned and pass, per source.

Every recording below DIR is learned by `learn`, in libraries of 8 to 16 motions of one source each (the folder that
the files lie in), so that no setting is tuned to a few clips.
"""

import time
from collections import defaultdict
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks import command
from controller.training.learn import LearnedLibrary, learn, recordings_in
from motiondeck_base.errors import MotiondeckError

LARGEST = 16


def libraries_of(files: list[Path]) -> list[list[Path]]:
    """Files in groups of nearly one size, at most LARGEST each."""
    return [part.tolist() for part in np.array_split(np.array(files, dtype=object), -(-len(files) // LARGEST))]


def main(folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder that holds the recordings.")]) -> None:
    """Learn every recording of a folder in libraries of 8 to 16, and print what became of them per source."""
    sources: dict[Path, list[Path]] = defaultdict(list)
    for file in recordings_in([folder]):
        sources[file.parent].append(file)
    print(f"{'source':36} files   learned   passed   error, mm   seconds")
    for source, files in sources.items():
        begin, found = time.monotonic(), list[LearnedLibrary]()
        for part in libraries_of(files):
            try:
                found.append(learn(part, "zoo", seeds=[0]))
            except MotiondeckError as error:
                print(f"  {error}")
        motions = [motion for learned in found for motion in learned.motions]
        learned = [motion for motion in motions if motion.plays]
        error = float(np.median([motion.error_mm for motion in learned])) if learned else np.nan
        print(
            f"{source.relative_to(folder).as_posix()[-36:]:36} {len(files):5} {len(learned):9} "
            f"{sum(motion.passed for motion in learned):8} {error:11.2f} {time.monotonic() - begin:9.1f}"
        )
        for motion in motions:
            if not motion.passed:
                print(f"  {motion.file.name}: {motion.remedy}")


if __name__ == "__main__":
    command.run("zoo", main)
