"""Learn a library from two recordings, save it, and generate from it at another tempo.

The recordings here are made from a shipped library, so that the example runs anywhere. Give two files of your own
(.bvh, .amc, .c3d; loops such as walking) to learn those:

python examples/learn_two_motions.py walk.bvh dance.bvh --out mine.safetensors
"""

import argparse
import tempfile
from pathlib import Path

import motiondeck
from motiondeck import networks


def made_up_recordings(folder: Path) -> list[Path]:
    """Two BVH files with two rounds of a motion each."""
    library = motiondeck.load_library("thesis15")
    files = [folder / "walk.bvh", folder / "jog.bvh"]
    for file in files:
        motiondeck.save_recording(library.generate_clip(file.stem, seconds=2.5), file)
    return files


def main() -> None:
    """Learns, saves, loads and generates."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="*", type=Path)
    parser.add_argument("--out", type=Path, default=Path(tempfile.gettempdir()) / "two-motions.safetensors")
    parser.add_argument("--satellites", type=int, default=40, help="of each motion; more follow it more closely")
    options = parser.parse_args()

    with tempfile.TemporaryDirectory() as folder:
        recordings = options.recordings or made_up_recordings(Path(folder))
        # Centers and satellites learn in seconds. A ConceptorRecipe() or an EchoStateRecipe() learns a reservoir.
        network = networks.CentralizedRecipe(satellites=options.satellites, iterations=40)
        library = motiondeck.learn(recordings, name="two-motions", network=network, progress=print)
    for motion in library.motions:
        print(f"{motion}: {library.failed.get(motion, 'passed the self-test')}")
    library.save(options.out)

    again = motiondeck.load_library(options.out)
    channels = again.generate(again.motions[0], seconds=4.0, rate=100.0, tempo=1.2)
    print(f"{again.name}: {len(channels)} frames of {channels.shape[1]} channels")
    print(f"play it with: motiondeck play --library {options.out}")


if __name__ == "__main__":
    main()
