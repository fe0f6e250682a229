"""Walk settings: the table [walk] of a robot file."""

import re

import msgspec


class WalkSettings(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Settings of walking; heights and lengths in heights of the root, times in s."""

    share: float = 0.7  # of the length of the motion's steps
    longest: float = 0.6  # step, from foot to foot
    fastest: float = 2.2  # mean speed of a swinging foot, heights a second: quicker steps become shorter
    slowest: float = 3.3  # duration of a swing, in sqrt(height / g): slower ones stand on both feet first
    width: float = 0.36  # least distance between the soles
    bend: float = 0.08  # lowering of the root
    lift: float = 0.08  # of a swinging sole
    double_support: float = 0.04  # least time on both feet between two steps
    roll: float = 0.3  # way of the centre of pressure along the sole during a step, in lengths of the sole
    ahead: float = 0.8  # gain of a landing foot on the error of the capture point, forwards
    aside: float = 0.5  # the same sideways
    ankle: float = 0.9  # gain of the centre of mass on the remaining error
    # Largest shift of the centre of mass to a side, in half lengths of the sole (ahead 0.8): beyond the half width of
    # the sole a stiff ankle lifts the foot onto its edge.
    lean: float = 0.28
    upright: float = 0.6  # share of the trunk's tilt that the swinging foot compensates
    feed_forward: float = 0.6  # share of gravity's torques that the servos of the legs get in advance
    toe: float = 0.3  # pitch over the toes at leaving, for the longest step, rad
    heel: float = 0.15  # the same over the heel at landing


def with_walk_table(text: str, settings: WalkSettings) -> str:
    """The text of a robot file with these settings as its table [walk], up to an empty line, a table or the end."""
    lines = [f"{name} = {value:.3g}" for name, value in msgspec.structs.asdict(settings).items()]
    table = "\n".join(["[walk]", *lines]) + "\n"
    there = re.search(r"^\[walk\][^\n]*\n(?:[^\[\n][^\n]*(?:\n|\Z))*", text, re.MULTILINE)
    if there is None:
        return f"{text.rstrip()}\n\n{table}"
    after = text[there.end() :]
    return text[: there.start()] + table + ("\n" if after else "") + after
