"""The deck process killed, stopped and stalled at random moments of a motion: what its joints do.

Only the deck process gets the signals: SIGKILL, or SIGSTOP and SIGCONT after 0.02 to 2 s (a stop) or 3 to 20 ms (a
stall). See `goal_judge` for how it is judged.
"""

from __future__ import annotations

import random
import signal
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.stop import goal_judge as judge
from benchmarks.stop.judged_rig import JudgedDeck, JudgedRig

MOTIONS = ("jog", "box1")
MOST = 1.02  # of a limit that a judged path may show
_NEAR = 0.1  # rad
_A_RUN = 12  # stops and stalls in one deck
_PARTS = {"kill": 0.15, "stop": 0.4, "stall": 0.45}
_SEEN = 1.0  # s after a kill
_AFTERWARDS = 0.4  # s after a stall or a stop in which joints may still be affected
_BEFORE = 0.05  # s
_MOST_REPEATED = 2  # times as many as are judged
_BRAKES = 0.1  # s; a stop at least so long must bring the joints to rest


@dataclass
class Strike:
    """One signal and what came of it.

    Attributes:
        kind: kill, stop or stall.
        at, end: from the signal to when the next thing happens, s (CLOCK_MONOTONIC).
        stopped: for how long the deck was stopped, s; infinite if killed.
        acceleration, velocity: of the goals, as parts of their limits.
        shaft: acceleration of the true shafts as a part of its limit.
        braking_after, still_after: see `goal_judge.Standstill`.
        outside: whether a shaft left its range.
        elsewhere: how far from its shaft a servo was set up, rad.
    """

    motion: str
    kind: str
    at: float
    stopped: float
    end: float = 0.0
    acceleration: float = 0.0
    velocity: float = 0.0
    shaft: float = 0.0
    braking_after: float | None = None
    still_after: float | None = None
    outside: bool = False
    elsewhere: float = 0.0

    @property
    def moves_until(self) -> float:
        """When its goals stand for good, or the next thing happens, s: later nothing can come late."""
        stands = self.kind == "kill" and self.still_after is not None
        return min(self.end, self.at + (self.still_after or 0.0) + 0.1) if stands else self.end

    @property
    def within(self) -> bool:
        """Whether the goals stayed within their limits, and no servo was set up where its shaft was not."""
        return max(self.acceleration, self.velocity) <= MOST and self.elsewhere < _NEAR


@dataclass
class Result:
    """What came of all strikes, the largest part of a limit in undisturbed play, and how many were made again."""

    strikes: list[Strike] = field(default_factory=list)
    undisturbed: float = 0.0
    repeated: int = 0

    @property
    def good(self) -> bool:
        """Whether goals and shafts stayed within all limits and ranges."""
        return all(strike.within and not strike.outside for strike in self.strikes)


Run = tuple[str, str, list[float]]
"""A run of a deck: its motion, how it ends (kill or end), and how long each stop and stall takes, s."""


def plan(count: int, seed: int) -> list[Run]:
    """Runs with so many strikes."""
    rng = random.Random(seed)
    kills = round(count * _PARTS["kill"])
    pauses = [10.0 ** rng.uniform(-1.7, 0.3) for _ in range(round(count * _PARTS["stop"]))]
    pauses += [rng.uniform(0.003, 0.02) for _ in range(count - kills - len(pauses))]
    rng.shuffle(pauses)
    runs = max(kills, -(-len(pauses) // _A_RUN))
    return [(MOTIONS[run % len(MOTIONS)], "kill" if run < kills else "end", pauses[run::runs]) for run in range(runs)]


def strike(runs: list[Run], seed: int, options: tuple[str, ...] = ()) -> Result:
    """Strikes at random moments; those in which the machine was too busy to be judged are made again."""
    rng = random.Random(seed + 1)
    found, left = Result(), list(runs)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        with JudgedRig(folder) as rig:
            while left and found.repeated <= _MOST_REPEATED * (1 + len(found.strikes)):
                motion, end, pauses = left.pop(0)
                rig.forget()
                with JudgedDeck(rig, folder, motion, "--headless", "--command-port", "7000", *options) as deck:
                    deck.plays()
                    begin = time.monotonic()
                    own = _strike_one(deck, rng, motion, end, pauses)
                    over = time.monotonic()
                undisturbed = _judge(rig, own, begin, over)
                good = [one for one in own if not rig.disturbed(one.at - _BEFORE, one.moves_until)]
                found.strikes += good
                if not rig.disturbed(begin, own[0].at if own else over):
                    found.undisturbed = max(found.undisturbed, undisturbed)
                found.repeated += len(own) - len(good)
                again = [one for one in own if one not in good]
                pauses = [one.stopped for one in again if one.kind != "kill"]
                if again:
                    left.append((motion, "kill" if len(pauses) < len(again) else "end", pauses))
    return found


def _strike_one(deck: JudgedDeck, rng: random.Random, motion: str, end: str, pauses: list[float]) -> list[Strike]:
    own: list[Strike] = []
    for pause in pauses:
        time.sleep(rng.uniform(0.3, 1.0))
        deck.plays()
        at = deck.signal(signal.SIGSTOP)
        time.sleep(pause)
        deck.signal(signal.SIGCONT)
        own.append(Strike(motion, "stop" if pause > 0.02 else "stall", at, pause))
        time.sleep(_AFTERWARDS)
    if end == "kill":
        time.sleep(rng.uniform(0.3, 1.0))
        deck.plays()
        own.append(Strike(motion, "kill", deck.signal(signal.SIGKILL), float("inf")))
        time.sleep(_SEEN)
    return own


def _judge(rig: JudgedRig, strikes: list[Strike], begin: float, over: float) -> float:
    """Judges the strikes of one deck; the largest part of a limit before the first one."""
    joints = rig.joints
    goals = judge.read_goals(rig.bus, joints).between(begin, over)
    shafts = judge.read_shafts(rig.shafts).between(begin, over)
    track = judge.on_grid(goals, joints.period, over)
    hardest = judge.acceleration_parts(track, joints).max(axis=1)
    fastest = judge.velocity_parts(track, joints).max(axis=1)
    ends = [strike.at for strike in strikes[1:]] + [over]
    for one, end in zip(strikes, ends, strict=True):
        one.end = end
        here = (track.times > one.at - joints.period) & (track.times <= end - joints.period)
        one.acceleration, one.velocity = float(hardest[here].max()), float(fastest[here].max())
        own = shafts.between(one.at, end)
        one.shaft = judge.shaft_acceleration(own, joints)
        low, high = joints.lower - 0.02, joints.upper + 0.02
        one.elsewhere = judge.set_up_elsewhere(goals.between(one.at, end), shafts)
        one.outside = bool(((own.positions < low) | (own.positions > high)).any())
        if one.stopped > _BRAKES:
            until = min(one.at + one.stopped, end)
            still = judge.standstill(track.until(until), joints, one.at)
            one.braking_after, one.still_after = still.braking_after, still.still_after
    before = track.times < strikes[0].at - 2.0 * joints.period if strikes else np.ones(len(track.times), dtype=bool)
    return float(max(hardest[before].max(initial=0.0), fastest[before].max(initial=0.0)))


def table(result: Result) -> str:
    """The result as a Markdown table."""
    columns = ("the deck is", "goals within limits", "shafts within range", "worst part of a limit (goals)",
               "of a true shaft", "braking begins after, ms: p50, worst", "at rest after, ms: worst")  # fmt: skip
    head = f"| {' | '.join(columns)} |"
    rows = [head, "|---|---|---|---|---|---|---|"]
    names = {"kill": "killed (SIGKILL)", "stop": "stopped for 0.02 to 2 s", "stall": "stalled for 3 to 20 ms"}
    for kind, name in names.items():
        own = [strike for strike in result.strikes if strike.kind == kind]
        if not own:
            continue
        good = sum(strike.within for strike in own)
        ranged = sum(not strike.outside for strike in own)
        worst = max(max(strike.acceleration, strike.velocity) for strike in own)
        braking = sorted(1e3 * one.braking_after for one in own if one.braking_after is not None)
        still = [1e3 * one.still_after for one in own if one.still_after is not None]
        begins = f"{np.median(braking):.0f}, {braking[-1]:.0f}" if braking else ""
        rows.append(
            f"| {name} | {good} of {len(own)} | {ranged} of {len(own)} | {worst:.2f} | "
            f"{max(strike.shaft for strike in own):.2f} | {begins} | {f'{max(still):.0f}' if still else ''} |"
        )
    good = sum(strike.within for strike in result.strikes)
    rows += ["", f"Goals within limits: {good} of {len(result.strikes)}. Undisturbed play: {result.undisturbed:.2f}."]
    if result.repeated:
        rows += [f"{result.repeated} more could not be judged, as the machine was too busy, and were made again."]
    return "\n".join(rows)
