"""Three motions done by three made-up people, so that recognition is tested without recordings."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from controller.learning.recognition.labelled_recordings import Dataset, Example
from controller.motion.clip import walked_clip
from controller.motion.encodings.bone_directions import BoneDirections
from synthetic import RATE, bow, march, small_encoding, small_skeleton, wave

CLASSES = ("bow", "march", "wave")
PEOPLE = ("ann", "bob", "cem")


def person(name):
    """Everybody has limbs of another length."""
    rng = np.random.default_rng(PEOPLE.index(name))
    skeleton = small_skeleton()
    return replace(skeleton, name=name, length=skeleton.length * rng.uniform(0.85, 1.15, len(skeleton)))


def frames(motion, pace, shift):
    """A take of a motion at a pace, begun elsewhere."""
    if motion == "bow":
        return bow(round(150 * pace))
    make = {"march": march, "wave": wave}[motion]
    period = make(round(100 * pace))
    return np.roll(np.concatenate([period, period]), shift, axis=0)


def clip(motion, who="ann", pace=1.0, shift=0):
    encoding = BoneDirections(person(who))
    return walked_clip(
        motion, encoding.skeleton, encoding.decode(frames(motion, pace, shift)), RATE, f"{who}-{motion}.amc"
    )


def dataset(people=PEOPLE, motions=CLASSES, takes=3):
    examples = []
    for motion in motions:
        for number, who in enumerate(people):
            for take in range(takes):
                pace = 0.85 + 0.1 * ((number + 2 * take) % 4)
                path = Path(motion) / f"{who}_{take}.amc"
                examples.append(Example(clip(motion, who, pace, 13 * take + 7 * number), motion, who, path))
    return Dataset(examples, [])


def channels():
    return small_encoding().channels


ASF = """\
:version 1.10
:name {name}
:units
  mass 1.0
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name leg
    direction 0 -1 0
    length 15
    axis 0 0 0 XYZ
    dof rx ry rz
  end
  begin
    id 2
    name arm
    direction 1 0 0
    length 8
    axis 0 0 0 XYZ
    dof rx ry rz
  end
:hierarchy
  begin
    root leg arm
  end
"""


def amc(swing, count=80, pace=1.0):
    """The text of a recording in which 'leg' or 'arm' swings."""
    lines = [":FULLY-SPECIFIED", ":DEGREES"]
    for t in range(count):
        angle = 35.0 * np.sin(0.2 * t / pace)
        leg, arm = (angle, 3.0) if swing == "leg" else (2.0, angle)
        lines += [str(t + 1), "root 0 17 0 0 0 0", f"leg {leg:.4f} 0 0", f"arm 0 {arm:.4f} {0.5 * arm:.4f}"]
    return "\n".join(lines) + "\n"


def write_folder(folder, people=("P1", "P2")):
    """A folder of labelled recordings of two motions by two people."""
    for who in people:
        (folder / f"{who}.asf").write_text(ASF.format(name=who))
    for motion in ("leg", "arm"):
        (folder / motion).mkdir()
        for number, who in enumerate(people):
            for take in range(3):
                text = amc(motion, 80 + 5 * take, 1.0 + 0.1 * number + 0.05 * take)
                (folder / motion / f"{who}_{motion}_{take}.amc").write_text(text)
    return folder
