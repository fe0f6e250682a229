"""A written recording: a person who stands, puts something on the floor with a bent trunk, and stands up again, as BVH.

Neck and shoulders hang from Spine1, as in MotionBuilder's files. A root whose zero is not upright, as in many
recordings, pitches by the same angle in each frame, and its children turn back by it.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

RATE = 60.0  # Hz
SECONDS = 3.0
# Angles of the lowest posture from upright, degrees: pelvis, spine (two equal bends above it), thighs, shanks.
PELVIS, BEND, THIGH, SHANK = 50.0, 20.0, -65.0, 32.0
ELBOW = 70.0  # bend of the elbows standing, which the reach to the floor straightens, degrees
THIGH_LENGTH, SHANK_LENGTH, ANKLE = 0.42, 0.42, 0.08
HIP = np.array([0.09, -0.03, 0.0])
# Each joint: the one above it and its offset in a T-pose, m, y up, z ahead, x to the left.
_TRUNK = {
    "Hips": ("", (0.0, 0.0, 0.0)),
    "LowerBack": ("Hips", (0.0, 0.06, 0.0)),
    "Spine": ("LowerBack", (0.0, 0.12, 0.0)),
    "Spine1": ("Spine", (0.0, 0.12, 0.0)),
    "Neck": ("Spine1", (0.0, 0.2, 0.0)),
    "Head": ("Neck", (0.0, 0.1, 0.0)),
}
_LIMB = (
    ("UpLeg", "Hips", tuple(HIP)),
    ("Leg", "UpLeg", (0.0, -THIGH_LENGTH, 0.0)),
    ("Foot", "Leg", (0.0, -SHANK_LENGTH, 0.0)),
    ("ToeBase", "Foot", (0.0, -0.06, 0.13)),
    ("Shoulder", "Spine1", (0.03, 0.13, 0.0)),
    ("Arm", "Shoulder", (0.14, 0.0, 0.0)),
    ("ForeArm", "Arm", (0.28, 0.0, 0.0)),
    ("Hand", "ForeArm", (0.25, 0.0, 0.0)),
    ("HandIndex1", "Hand", (0.08, 0.0, 0.0)),
)


def written_bend(root_pitch: float = 0.0, chest: float = BEND) -> str:
    """The BVH text; `root_pitch` is the pitch of the root's zero, `chest` the bend where the arms hang, degrees."""
    joints = dict(_TRUNK)
    for side, left in (("Left", 1.0), ("Right", -1.0)):
        for name, above, (x, y, z) in _LIMB:
            joints[side + name] = (above if above in joints else side + above, (left * x, y, z))
    for name, (above, offset) in joints.items():
        if above == "Hips":
            joints[name] = above, tuple(_pitch(-root_pitch).apply(offset))
    order: list[str] = []
    hierarchy = "HIERARCHY\n" + _block("Hips", joints, order)
    time = np.arange(0.0, SECONDS, 1.0 / RATE)
    share = np.clip(np.minimum(time - 0.4, SECONDS - 0.4 - time), 0.0, 0.9) / 0.9
    rows = [_frame(order, 0.5 - 0.5 * np.cos(np.pi * s), root_pitch, chest) for s in share]
    lines = "\n".join(" ".join(f"{value:.6f}" for value in row) for row in rows)
    return f"{hierarchy}MOTION\nFrames: {len(rows)}\nFrame Time: {1.0 / RATE:.8f}\n{lines}\n"


def _block(name: str, joints: dict[str, tuple[str, tuple[float, ...]]], order: list[str]) -> str:
    order.append(name)
    offset = " ".join(f"{value:.6f}" for value in joints[name][1])
    below = [other for other, (above, _) in joints.items() if above == name]
    channels = "6 Xposition Yposition Zposition" if name == "Hips" else "3"
    text = f"{'ROOT' if name == 'Hips' else 'JOINT'} {name}\n{{\nOFFSET {offset}\n"
    text += f"CHANNELS {channels} Zrotation Yrotation Xrotation\n"
    text += "".join(_block(other, joints, order) for other in below)
    return text + ("" if below else "End Site\n{\nOFFSET 0.0 0.05 0.0\n}\n") + "}\n"


def _frame(order: list[str], share: float, root_pitch: float, chest: float) -> list[float]:
    pelvis, bend, thigh, shank = (share * angle for angle in (PELVIS, BEND, THIGH, SHANK))
    trunk = pelvis + bend + share * chest
    turned = {"Hips": _pitch(pelvis + root_pitch), "LowerBack": _pitch(-root_pitch)}
    turned |= {"Spine": _pitch(bend), "Spine1": _pitch(share * chest), "Neck": _pitch(-0.5 * trunk)}
    for side, left in (("Left", 1.0), ("Right", -1.0)):
        turned[f"{side}UpLeg"] = _pitch(thigh - pelvis - root_pitch)
        turned[f"{side}Leg"], turned[f"{side}Foot"] = _pitch(shank - thigh), _pitch(-shank)
        hangs = Rotation.from_euler("z", -left * 85.0, degrees=True)
        turned[f"{side}Arm"] = _pitch(-trunk) * hangs
        turned[f"{side}ForeArm"] = hangs.inv() * _pitch((share - 1.0) * ELBOW) * hangs
    legs = _pitch(thigh).apply([0.0, -THIGH_LENGTH, 0.0]) + _pitch(shank).apply([0.0, -SHANK_LENGTH, 0.0])
    root = np.array([0.0, ANKLE, 0.0]) - legs - _pitch(pelvis).apply(HIP * [0.0, 1.0, 1.0])
    angles = [turned[name].as_euler("ZYX", degrees=True) if name in turned else np.zeros(3) for name in order]
    return [*root, *np.concatenate(angles)]


def _pitch(degrees: float) -> Rotation:
    return Rotation.from_euler("x", degrees, degrees=True)
