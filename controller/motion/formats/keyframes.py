"""Keyframes (.toml): where joints are at a few times, and how they come there.

    unit = "deg"                         # or "rad", of all values
    plays = "loop"                       # or "once", the default
    length = 2.0                         # s; without it the motion ends with its last key
    rest = { neck = 0, jaw = 0 }         # joints at the beginning, and those that stay there

    [[key]]
    at = 0.5                             # s
    joint = "jaw"                        # or several: pose = { jaw = 20, neck = -5 }
    value = 20
    easing = "ease"                      # of the way to this key

smooth, the default, passes through the keys by a monotone cubic (Fritsch and Butland 1984), which never goes beyond two
neighbouring keys; all others leave a key and come to the next at rest. A loop goes from its last key on to its first.
Before a joint's first key (without `rest`) and, played once, after its last one it stays. Speeds never jump.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np

from controller.motion.canonical.clip_edits import cubic
from controller.motion.clip import ANGLE_UNITS, AS_FOUND, Clip, Format, Plays, ReadingOptions
from controller.motion.formats.taught_clip import taught_clip
from controller.motion.quintic import rise
from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from motiondeck_base.toml_file import read_toml

_LONGEST = 3600.0  # s
_KEY = re.compile(rb"^\s*(\[\[\s*key\s*\]\]|key\s*=)", re.MULTILINE)

Easing = Literal["smooth", "ease", "early", "late", "overshoot"]
EASINGS: dict[str, Callable[[Array], Array]] = {
    "ease": rise,
    "early": lambda s: rise(1.0 - (1.0 - s) ** 2),  # quick at first
    "late": lambda s: rise(s**2),
    "overshoot": lambda s: rise(s) + 9.0 * s**4 * (1.0 - s) ** 2,  # 9 % too far, and back
}
"""From 0 to 1 for s in [0, 1], with slope 0 at both ends."""


class Key(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Where joints are at a time, s, in the unit of the file."""

    at: Annotated[float, msgspec.Meta(ge=0.0, le=_LONGEST)]
    joint: str = ""
    value: float | None = None
    pose: dict[str, float] = {}
    easing: Easing = "smooth"

    def __post_init__(self) -> None:
        if bool(self.joint) != (self.value is not None) or bool(self.joint) == bool(self.pose):
            raise ValueError("a key needs a joint and its value, or else a pose of several")

    @property
    def values(self) -> dict[str, float]:
        """The values of the joints that it has."""
        return self.pose or {self.joint: self.value or 0.0}


class Keyframes(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A file of keyframes."""

    key: list[Key]
    unit: Literal["deg", "rad"] | None = None
    plays: Plays = "once"
    length: Annotated[float, msgspec.Meta(gt=0.0, le=_LONGEST)] | None = None
    rest: dict[str, float] = {}
    rate: Annotated[float, msgspec.Meta(ge=10.0, le=1000.0)] = 100.0  # Hz, at which it is drawn up


def read_keyframes(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The take that keyframes describe, from their beginning to their end; a loop ends in its first frame."""
    options.refuse(path)
    return drawn_up(read_toml(Path(path), Keyframes), path)


def drawn_up(written: Keyframes, path: str | Path) -> Clip:
    """The take of keyframes; FileFormatError, which names their file, if they contradict each other."""
    if not written.key:
        raise FileFormatError(f"{path}: there is no [[key]] in it. Write one.")
    if written.unit is None:
        raise FileFormatError(f'{path}: the values have no unit. Write unit = "deg" or unit = "rad" above the keys.')
    length = written.length or max(key.at for key in written.key)
    late = next((key.at for key in written.key if key.at > length), None)
    if late is not None or length <= 0.0:
        raise FileFormatError(f"{path}: the key at {late or 0:g} s is not before the end at {length:g} s. Set length.")
    frames = max(2, round(length * written.rate))
    times = np.linspace(0.0, length, frames + 1)
    joints = list(dict.fromkeys([*written.rest, *(joint for key in written.key for joint in key.values)]))
    courses = [_course(times, _keys_of(joint, written, length, path), written.plays) for joint in joints]
    angles = ANGLE_UNITS[written.unit] * np.stack(courses, axis=1)
    with FileFormatError.placed(path):
        return taught_clip(Path(path).stem, joints, frames / length, angles, Path(path).name, written.plays)


_Keys = dict[float, tuple[float, Easing]]
"""The values of one joint, and the way to each, by their times; of a loop without its end, which is its beginning."""


def _keys_of(joint: str, written: Keyframes, length: float, path: str | Path) -> _Keys:
    found: _Keys = {}
    for key in sorted(written.key, key=lambda key: key.at):
        if joint not in key.values:
            continue
        value, easing, at = key.values[joint], key.easing, key.at
        if written.plays == "loop" and at == length:
            if found.get(at := 0.0, (value,))[0] != value:
                raise FileFormatError(
                    f"{path}: the loop begins with {joint} at {found[0.0][0]:g} and ends at {value:g}. Make them equal."
                )
        elif at in found:
            raise FileFormatError(f"{path}: {joint} has two keys at {at:g} s. Leave one out.")
        found[at] = (value, easing)
    if joint in written.rest:
        found.setdefault(0.0, (written.rest[joint], "smooth"))
    return dict(sorted(found.items()))


def _course(times: Array, keys: _Keys, plays: Plays) -> Array:
    """The values of a joint at some times, from the first to the last one."""
    from scipy.interpolate import PchipInterpolator  # slow to import, and a deck imports all formats

    length, at = float(times[-1]), np.array(list(keys))
    value, easings = np.array([value for value, _ in keys.values()]), [easing for _, easing in keys.values()]
    if plays == "loop":
        at, value, easings = np.concatenate([at - length, at, at + length]), np.tile(value, 3), easings * 3
    at = np.concatenate([at[:1] - length - 1.0, at, at[-1:] + length + 1.0])  # it stays before and after them
    value, easings = np.concatenate([value[:1], value, value[-1:]]), ["smooth", *easings, "smooth"]
    slope = np.asarray(PchipInterpolator(at, value).derivative()(at))
    eased = np.array([easing in EASINGS for easing in [*easings, "smooth"]])
    slope[eased[:-1] | eased[1:]] = 0.0  # at rest before and after the way
    found, part = np.empty(len(times)), np.clip(np.searchsorted(at, times, side="right") - 1, 0, len(at) - 2)
    for index in np.unique(part):
        here, long = part == index, at[index + 1] - at[index]
        s, ends = (times[here] - at[index]) / long, value[index : index + 2]
        if (ease := EASINGS.get(easings[index + 1])) is not None:
            found[here] = ends[0] + (ends[1] - ends[0]) * ease(s)
        else:
            found[here] = cubic(ends[0], long * slope[index], ends[1], long * slope[index + 1], s)
    return found


def is_keyframes(path: Path) -> bool:
    """Whether a .toml has keys, and is no recipe or other settings."""
    try:
        return _KEY.search(path.read_bytes()) is not None
    except OSError:
        return False


FORMAT = Format(suffixes=(".toml",), read=read_keyframes, matches=is_keyframes)
