"""Recognize a stream: which motion is being done, frame by frame.

The recognizer learns walking, jogging and boxing as a shipped library plays them, each at three tempos, and then sees
all three one after another at a fourth tempo. Give a folder with one folder of recordings a motion to learn those.

python examples/recognize_stream.py
"""

import argparse
from pathlib import Path

import numpy as np

import motiondeck

MOTIONS = ("walk", "jog", "box1")


def main() -> None:
    """Learns, then looks at a stream."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=Path, metavar="DIR")
    parser.add_argument("--seconds", type=float, default=3.0, help="of each motion in the stream")
    options = parser.parse_args()

    library = motiondeck.load_library("thesis15")
    clips = {
        motion: [library.generate_clip(motion, seconds=3.0, rate=60.0, tempo=tempo) for tempo in (0.8, 1.0, 1.25)]
        for motion in MOTIONS
    }
    recognizer = motiondeck.learn_recognizer(options.recordings or clips)

    stream = recognizer.stream()
    at, before = 0.0, None
    for motion in MOTIONS:
        clip = library.generate_clip(motion, seconds=options.seconds, rate=60.0, tempo=0.9)
        print(f"{at:5.2f} s: {motion} begins")
        right = []
        for frame in recognizer.frames(clip):
            stream.update(frame)
            right.append(stream.nearest == motion)
            if stream.nearest != before:
                print(f"{at:5.2f} s:   looks like {stream.nearest} (confidence {stream.confidence:.2f})")
                before = stream.nearest
            at += 1.0 / recognizer.rate
        print(f"         {np.mean(right):.0%} of its frames were seen as {motion}")


if __name__ == "__main__":
    main()
