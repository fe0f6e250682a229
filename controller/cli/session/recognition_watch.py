"""`motiondeck play --recognize`: experts of the library look at the measured joints, and say so when they disagree."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from controller.cli.session.robot_on_deck import RobotOnDeck
from controller.deck.interfaces import JointLimits, Retargeter
from controller.library.motion_library import MotionLibrary
from controller.loop.loop import LoopState
from controller.loop.output_channel import Channel
from controller.loop.stop_requests import StopRequest
from controller.recognition.deck_recognizer import joint_motions, teach_joints, unwind
from controller.recognition.deck_watch import DeckWatch
from controller.rotations import Array

# What the page is told, one number each.
NUMBERS = ("seen", "confidence", "mismatch_s", "stuck")
MOST_SAID = 20  # alarms on the terminal; the report has more


@dataclass(frozen=True)
class Watching:
    """What is asked of a watch.

    Attributes:
        patience: how long the joints may look like another motion than the commanded one, s.
        stop: whether an alarm ends the run.
    """

    patience: float
    stop: bool


class WatchedDeck(Protocol):
    """A deck as a watch sees it."""

    time: float

    @property
    def playing(self) -> str:
        """What is played now."""
        ...

    @property
    def settled(self) -> bool:
        """Whether no switch is under way."""
        ...


class RecognitionWatch:
    """Feeds a `DeckWatch` from the loop, and says what it finds on the terminal, on the page and in the report."""

    @classmethod
    def over(
        cls, body: RobotOnDeck, channel: Channel, library: MotionLibrary, rate: float, asked: Watching
    ) -> RecognitionWatch:
        """A watch over the joints of a body that one of its channels measures."""
        robot = body.robot
        retarget = deepcopy(robot.retarget)  # one that remembers a pose must not remember the last one taught
        return cls(asked, library, retarget, robot.joints, robot.layout.ball, body.limits, channel, rate)

    def __init__(
        self,
        asked: Watching,
        library: MotionLibrary,
        retarget: Retargeter,
        joints: Sequence[str],
        balls: NDArray[np.int64],
        limits: JointLimits,
        channel: Channel,
        rate: float,
    ) -> None:
        """Teaches the experts.

        Args:
            asked: what to do.
            library: the motions.
            retarget: from its skeleton to the robot's joints.
            joints: the robot's joints; other robots' come after them in the targets.
            balls: which of them are rotation vectors, shape (N, 3).
            limits: what the joints may do.
            channel: the output whose measurements are looked at; joints that it does not measure are left out.
            rate: ticks a second, Hz.
        """
        measured = channel.output.measured()
        known = np.ones(len(joints), dtype=np.bool_) if measured is None else np.isfinite(measured[: len(joints)])
        self._order = np.flatnonzero(known)
        self._balls = np.searchsorted(self._order, balls[known[balls].all(1)])
        self._asked, self._channel = asked, channel
        motions = joint_motions(library, retarget)
        for name, targets in motions.items():
            motions[name] = np.clip(targets, limits.lower, limits.upper)[:, self._order]
            unwind(motions[name], self._balls)
        self.watch = DeckWatch(teach_joints(motions), [joints[j] for j in self._order.tolist()], rate, asked.patience)
        self._targets, self._measured = np.zeros(len(self._order)), np.zeros(len(self._order))
        self._time = -1.0
        self._said = 0
        self._stopped = False

    @property
    def seen(self) -> tuple[str, float] | None:
        """The motion that the joints look like and how surely, in [0, 1); None while they stand still."""
        return (self.watch.seen, self.watch.confidence) if self.watch.seen is not None else None

    def look(self, state: LoopState, deck: WatchedDeck, stop: StopRequest) -> None:
        """Takes in one tick; an alarm is said once, and ends the run if that was asked for."""
        played = stop.mode == "playing" and deck.time != self._time
        self._time = deck.time
        if self._channel.measured is None:
            return
        np.take(state.targets, self._order, out=self._targets)
        np.take(self._channel.measured, self._order, out=self._measured)
        unwind(self._targets, self._balls)
        unwind(self._measured, self._balls)
        settled = played and deck.settled
        for alarm in self.watch.update(self._targets, self._measured, deck.playing, settled=settled, at=deck.time):
            if self._asked.stop and not stop:
                stop.ask(alarm.text)
                self._stopped = True
            if self._said < MOST_SAID:
                self._said += 1
                print(f"motiondeck: at {alarm.at:.1f} s {alarm.text}", file=sys.stderr)

    def show(self, fields: dict[str, Array], motions: Sequence[str]) -> None:
        """Writes NUMBERS: indices into motions and into the robot's joints, -1 for none."""
        watch = self.watch
        fields["seen"][0] = motions.index(watch.seen) if watch.seen is not None else -1
        fields["confidence"][0] = watch.confidence
        fields["mismatch_s"][0] = watch.mismatch
        stuck = watch.stuck
        fields["stuck"][0] = self._order[int(stuck.argmax())] if stuck.any() else -1

    def report(self) -> dict[str, Any]:
        """What `--json` says of it."""
        watch = self.watch
        return {
            "right_share": watch.right,
            "seen_after_s": float(np.median(watch.seen_after)) if watch.seen_after else None,
            "switches_seen": len(watch.seen_after),
            "last": {"seen": watch.seen, "confidence": watch.confidence},
            "alarms": [asdict(alarm) for alarm in watch.alarms],
            "raised": watch.raised,
            "stopped": self._stopped,
        }


def in_words(report: dict[str, Any]) -> list[str]:
    """The lines of a run's summary."""
    share, after = report["right_share"], report["seen_after_s"]
    seen = f"the commanded motion was seen in {100.0 * share:.1f} % of the ticks" if share is not None else "nothing"
    when = f", {after:.2f} s after a switch had begun (median)" if after is not None else ""
    return [f"recognized from the joints: {seen}{when}; {report['raised']} alarms"]
