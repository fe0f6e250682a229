"""Makes examples/walk.bvh, a walk out of formulas: feet that stand still on the floor, and legs that reach them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

RATE, SECONDS, PERIOD, SPEED = 30, 6.0, 1.1, 105.0  # Hz, s, s for two steps, cm/s
THIGH, SHANK, ANKLE, HIPS = 42.0, 40.0, 8.0, 87.5  # cm
STANDS, LIFTS = 0.6, 11.0  # part of a period that a foot stands; cm that it is lifted
WALK = Path(__file__).parents[1] / "examples" / "walk.bvh"

# Of each joint: its parent, and where it is in that (cm; x left, y up, z forward).
JOINTS = {
    "Hips": (None, (0, 0, 0)),
    "Spine": ("Hips", (0, 10, 0)),
    "Chest": ("Spine", (0, 20, 0)),
    "Neck": ("Chest", (0, 22, 0)),
    "Head": ("Neck", (0, 10, 1)),
    **{
        f"{side}{name}": (parent if parent == "Chest" or parent == "Hips" else f"{side}{parent}", (sign * x, y, z))
        for side, sign in (("Left", 1), ("Right", -1))
        for name, parent, (x, y, z) in (
            ("Shoulder", "Chest", (4, 17, 0)),
            ("Arm", "Shoulder", (14, 0, 0)),
            ("ForeArm", "Arm", (0, -29, 0)),
            ("Hand", "ForeArm", (0, -25, 0)),
            ("UpLeg", "Hips", (9, -2, 0)),
            ("Leg", "UpLeg", (0, -THIGH, 0)),
            ("Foot", "Leg", (0, -SHANK, 0)),
            ("ToeBase", "Foot", (0, -ANKLE + 2, 14)),
        )
    },
}
ENDS = {"Head": (0, 18, 0), "Hand": (0, -16, 0), "ToeBase": (0, 0, 6)}


def walk() -> dict[str, np.ndarray]:
    """Angles about x by joint (deg; positive swings what hangs down back), and the hips' path (cm), frame by frame."""
    time = np.arange(int(RATE * SECONDS)) / RATE
    turn = time / PERIOD
    bob = 1.2 * np.cos(4 * np.pi * (turn - 0.05))
    sway = 1.8 * np.sin(2 * np.pi * (turn + 0.05))
    channels = {"path": np.stack([sway, HIPS - 1.2 + bob, SPEED * time], axis=1)}
    for side, phase in (("Left", turn), ("Right", turn + 0.5)):
        forward, up, pitch = _foot(phase % 1.0)
        down = HIPS - 1.2 + bob - 2.0 - up - ANKLE
        reach = np.minimum(np.hypot(forward, down), THIGH + SHANK - 0.3)
        knee = np.pi - np.arccos((THIGH**2 + SHANK**2 - reach**2) / (2 * THIGH * SHANK))
        lean = np.arctan2(forward, down)
        hip = lean + np.arccos((THIGH**2 + reach**2 - SHANK**2) / (2 * THIGH * reach))
        channels[f"{side}UpLeg"] = -np.degrees(hip)
        channels[f"{side}Leg"] = np.degrees(knee)
        channels[f"{side}Foot"] = np.degrees(hip - knee + pitch)
        swing = np.cos(2 * np.pi * (phase + 0.02))
        channels[f"{side}Arm"] = 24.0 * swing
        channels[f"{side}ForeArm"] = -22.0 + 12.0 * swing
    return channels


def _foot(phase: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """At phases in [0, 1): an ankle before the hips, its height above the stance (cm), the foot's pitch (rad, down)."""
    step = SPEED * PERIOD * STANDS
    air = np.clip((phase - STANDS) / (1.0 - STANDS), 0.0, 1.0)
    # The swing begins and ends with the velocity of the floor below the hips.
    back = -SPEED * PERIOD * (1.0 - STANDS)
    smooth = air**2 * (3 - 2 * air) * (step - back) + back * air
    forward = np.where(phase < STANDS, step * (0.5 - phase / STANDS), smooth - step / 2)
    up = LIFTS * np.sin(np.pi * air) ** 2
    return forward, up, 0.35 * np.sin(2 * np.pi * air) * np.sin(np.pi * air)


def text() -> str:
    """The file."""
    channels, lines = walk(), ["HIERARCHY"]
    _write("Hips", 0, lines)
    frames = len(channels["path"])
    lines += ["MOTION", f"Frames: {frames}", f"Frame Time: {1 / RATE:.7f}"]
    still = np.zeros(frames)
    columns = [*channels["path"].T]
    for name in _order("Hips"):
        columns += [channels.get(name, still), still, still]
    lines += [
        " ".join(f"{value + 0.0:.2f}".rstrip("0").rstrip(".") for value in row) for row in np.stack(columns, axis=1)
    ]
    return "\n".join(lines).replace("-0 ", "0 ") + "\n"


def _below(name: str) -> list[str]:
    return [joint for joint, (parent, _) in JOINTS.items() if parent == name]


def _order(name: str) -> list[str]:
    return [name, *(below for child in _below(name) for below in _order(child))]


def _write(name: str, depth: int, lines: list[str]) -> None:
    indent, inner = "  " * depth, "  " * (depth + 1)
    place = (
        "6 Xposition Yposition Zposition Xrotation Yrotation Zrotation"
        if depth == 0
        else "3 Xrotation Yrotation Zrotation"
    )
    lines += [f"{indent}{'JOINT' if depth else 'ROOT'} {name}", f"{indent}{{"]
    lines += [f"{inner}OFFSET {' '.join(f'{x:g}' for x in JOINTS[name][1])}", f"{inner}CHANNELS {place}"]
    for child in _below(name):
        _write(child, depth + 1, lines)
    for end, offset in ENDS.items():
        if name.endswith(end):
            lines += [
                f"{inner}End Site",
                f"{inner}{{",
                f"{inner}  OFFSET {' '.join(f'{x:g}' for x in offset)}",
                f"{inner}}}",
            ]
    lines.append(f"{indent}}}")


if __name__ == "__main__":
    WALK.write_text(text(), encoding="utf-8")
    print(f"wrote {WALK}")
