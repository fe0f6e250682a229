"""Walk settings: how a robot walks on its own feet; the table [walk] of a robot file."""

from __future__ import annotations

import re

import msgspec


class WalkSettings(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """How a robot walks. Heights and lengths are in heights of its root, times in s.

    Attributes:
        share: of the length of the motion's steps.
        longest: step, from foot to foot.
        fastest: swinging foot, on average, in heights a second: what is quicker in the motion becomes shorter.
        slowest: how long a swing takes at most, in sqrt(height / g): what is slower in the motion stands on both feet.
        width: between the soles, at least.
        bend: how much lower the root is carried than it is played.
        lift: of a swinging sole.
        double_support: how long both feet stand between two steps, at least.
        roll: the centre of pressure goes from behind the middle of the sole to before it during a step, in lengths
            of the sole.
        ahead: what a landing foot makes up for of the error of the capture point, forwards.
        aside: the same, sideways.
        ankle: how far the centre of mass is moved against what is left of that error.
        lean: how far it is moved to a side at most, in half lengths of the sole; ahead it is 0.8. Beyond the half width
            of the sole a stiff ankle lifts the foot onto its edge.
        upright: what the swinging foot makes up for of how far the trunk's tilt moves it, as a share.
        feed_forward: the share of the torques of gravity that the servos of the legs get in advance.
        toe: how far a foot is turned over its toes when it leaves the floor after the longest step, rad.
        heel: how far it is turned over its heel when it lands after the longest step, rad.
    """

    share: float = 0.7
    longest: float = 0.6
    fastest: float = 2.2
    slowest: float = 3.3
    width: float = 0.36
    bend: float = 0.08
    lift: float = 0.08
    double_support: float = 0.04
    roll: float = 0.3
    ahead: float = 0.8
    aside: float = 0.5
    ankle: float = 0.9
    lean: float = 0.28
    upright: float = 0.6
    feed_forward: float = 0.6
    toe: float = 0.3
    heel: float = 0.15


def with_walk_table(text: str, settings: WalkSettings) -> str:
    """The text of a robot file with these settings as its table [walk]; all else stays as it is.

    A table ends with an empty line, the next table or the file.
    """
    lines = [f"{name} = {value:.3g}" for name, value in msgspec.structs.asdict(settings).items()]
    table = "\n".join(["[walk]", *lines]) + "\n"
    there = re.search(r"^\[walk\][^\n]*\n(?:[^\[\n][^\n]*(?:\n|\Z))*", text, re.MULTILINE)
    if there is None:
        return f"{text.rstrip()}\n\n{table}"
    after = text[there.end() :]
    return text[: there.start()] + table + ("\n" if after else "") + after
