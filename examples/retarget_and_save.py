"""Carry a clip onto a robot and save its joint angles.

python examples/retarget_and_save.py --out walk.csv
python examples/retarget_and_save.py 02_01.amc --robot my-robot.toml --out walk.clip
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

import motiondeck


def main() -> None:
    """Retargets a recording, or two seconds of a shipped motion where none is given."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", nargs="?", type=Path)
    parser.add_argument("--robot", default="servo20", help="a shipped robot, or a robot file")
    parser.add_argument("--out", type=Path, default=Path(tempfile.gettempdir()) / "walk.csv", help=".csv or .clip")
    options = parser.parse_args()

    if options.recording is not None:
        clip = motiondeck.read_recording(options.recording)
    else:
        clip = motiondeck.load_library("thesis15").generate_clip("walk", seconds=2.0, rate=100.0)
    motion = motiondeck.load_robot(options.robot).retarget(clip)
    motion.save(options.out)

    swing = np.degrees(np.ptp(motion.angles, axis=0))
    for joint in np.argsort(-swing)[:5]:
        print(f"{motion.joints[joint]:>12} swings over {swing[joint]:3.0f} degrees")
    print(f"wrote {len(motion)} frames of {len(motion.joints)} joints to {options.out}")


if __name__ == "__main__":
    main()
