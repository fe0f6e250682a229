"""The keys of a motion that is being written: set, moved and deleted in any order, and their file."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from controller.motion.clip import Clip, Plays
from controller.motion.formats.keyframes import Easing, Key, Keyframes, drawn_up
from motiondeck_base.toml_file import toml_key

Way = tuple[float, Easing]
_TO_MS, _TO_DEG = 3, 4  # decimals of a time, s, and of an angle, deg


@dataclass
class KeySheet:
    """Keys by their times, s: where each joint is, deg, and how it comes there."""

    plays: Plays
    length: float  # s
    keys: dict[float, dict[str, Way]] = field(default_factory=dict[float, dict[str, Way]])
    rate: float = 100.0  # Hz, at which it is drawn up

    @classmethod
    def of(cls, written: Keyframes) -> "KeySheet":
        """The sheet of a file; its `rest` is a key at 0 s."""
        unit = math.degrees if written.unit == "rad" else float
        sheet = cls(
            written.plays, written.length or max((key.at for key in written.key), default=1.0), {}, written.rate
        )
        for key in written.key:
            sheet.set(key.at, {joint: unit(value) for joint, value in key.values.items()}, key.easing)
        first = sheet.keys.get(0.0, {})
        sheet.set(0.0, {joint: unit(value) for joint, value in written.rest.items() if joint not in first})
        return sheet

    def copy(self) -> "KeySheet":
        """A sheet that goes its own way."""
        return replace(self, keys={at: dict(key) for at, key in self.keys.items()})

    def set(self, at: float, pose: Mapping[str, float], easing: Easing = "smooth") -> float:
        """Sets joints, deg, at a time, s, which is returned: the end of a loop is its beginning."""
        at = round(at, _TO_MS) + 0.0
        at = 0.0 if self.plays == "loop" and at == round(self.length, _TO_MS) else at
        if pose:
            key: dict[str, Way] = {joint: (round(value, _TO_DEG), easing) for joint, value in pose.items()}
            self.keys = dict(sorted((self.keys | {at: self.keys.get(at, {}) | key}).items()))
        return at

    def delete(self, at: float) -> None:
        """Deletes the key at a time, s, if there is one."""
        self.keys.pop(at, None)

    def move(self, at: float, to: float) -> float:
        """Moves a key; where it meets another, its joints win. The time at which it is then, s."""
        for joint, (value, easing) in self.keys.pop(at, {}).items():
            at = self.set(to, {joint: value}, easing)
        return at

    @property
    def written(self) -> Keyframes:
        """The same as a file has it: a row for each time and easing."""
        rows: list[Key] = []
        for at, key in self.keys.items():
            ways: list[Easing] = [way for _, way in key.values()]
            for easing in dict.fromkeys(ways):
                pose = {joint: value for joint, (value, way) in key.items() if way == easing}
                rows.append(Key(at, pose=pose, easing=easing))
        return Keyframes(rows, "deg", self.plays, self.length, rate=self.rate)

    @property
    def text(self) -> str:
        """The contents of its file."""
        rate = f"rate = {self.rate}\n" if self.rate != 100.0 else ""
        lines = [f'unit = "deg"\nplays = "{self.plays}"\nlength = {self.length}\n{rate}key = [']
        for key in self.written.key:
            pose = ", ".join(f"{toml_key(joint)} = {value}" for joint, value in key.pose.items())
            easing = f', easing = "{key.easing}"' if key.easing != "smooth" else ""
            lines.append(f"  {{ at = {key.at}, pose = {{ {pose} }}{easing} }},")
        return "\n".join([*lines, "]\n"])

    def clip(self, name: str) -> Clip:
        """The motion; FileFormatError if the keys contradict each other, or there is none."""
        return drawn_up(self.written, name)
