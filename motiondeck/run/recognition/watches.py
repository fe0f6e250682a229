"""Recognition during a run: of motions that the measured joints show, or that a saved recognizer sees in the body."""

from __future__ import annotations

import sys
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from controller.deck.interfaces import JointLimits, Retargeter
from controller.library.motion_library import MotionLibrary
from controller.loop.commands.interfaces import PlayableDeck
from controller.loop.loop import LoopState
from controller.loop.output_channel import Channel
from controller.loop.stop_requests import StopRequest
from controller.motion.skeleton import Skeleton
from controller.wire.messages.deck_snapshot import Recognized

if TYPE_CHECKING:
    from controller.learning.recognition.recognizer import Recognizer

MOST_KEPT = 1000  # times at which another motion was seen, the latest


class BodyWatch:
    """Feeds a `BodyRecognizer` with the poses that targets are made from; MotiondeckError if a joint is missing."""

    def __init__(self, recognizer: Recognizer, skeleton: Skeleton) -> None:
        from controller.learning.recognition.recognizer import BodyRecognizer

        self._body = BodyRecognizer(recognizer, skeleton)
        self.names: Sequence[str] = self._body.online.classes  # the recognizer's motions
        # Nothing is commanded that these motions could miss.
        self.mismatch_s, self.stuck = 0.0, ""
        self._time: float | None = None
        self._spent: Counter[tuple[str, str]] = Counter()  # ticks, by what was played and what was seen
        self._spans: deque[tuple[float, str]] = deque(maxlen=MOST_KEPT)

    @property
    def seen(self) -> Recognized | None:
        """The recognized motion, with its confidence; None while none is certain."""
        return Recognized(self._body.seen, self._body.online.confidence) if self._body.seen is not None else None

    def update(self, state: LoopState, deck: PlayableDeck, stop: StopRequest) -> None:
        """Takes in one tick; while the deck's time stands still there is nothing to be seen."""
        dt = deck.time - self._time if self._time is not None else 0.0
        if dt <= 0.0 and self._time is not None:
            return
        self._time = deck.time
        seen = self._body.update(state.pose.root_position, state.pose.rotation, dt) or ""
        self._spent[deck.playing, seen] += 1
        if seen != (self._spans[-1][1] if self._spans else ""):
            self._spans.append((deck.time, seen))

    def report(self) -> dict[str, Any]:
        """Its part of the report: what was seen of each motion that was played, and when."""
        shares: dict[str, dict[str, float]] = {}
        for (played, seen), ticks in self._spent.items():
            shares.setdefault(played, {})[seen or "nothing sure"] = float(ticks)
        for of in shares.values():
            total = sum(of.values())
            of.update((seen, ticks / total) for seen, ticks in of.items())
        return {"seen": [{"at": at, "motion": seen or None} for at, seen in self._spans], "shares": shares}


MOST_PRINTED = 20  # alarms on the terminal; the report has more


class RecognitionWatch:
    """Feeds a `DeckWatch` from the loop and shows what it finds on the terminal, on the page and in the report."""

    def __init__(
        self,
        library: MotionLibrary,
        retarget: Retargeter,
        joints: Sequence[str],
        balls: NDArray[np.int64],
        limits: JointLimits,
        channel: Channel,
        rate: float,
        patience: float,
        *,
        stop: bool,
    ) -> None:
        """Teaches the experts; joints that the channel does not measure are left out.

        Triples of joints that are rotation vectors are in `balls`, shape (N, 3); the rate is ticks a second, Hz. After
        `patience` seconds in which the joints look like another motion there is an alarm, which may `stop` the run.
        """
        # What recognizes takes longer to import than all that plays, and few runs recognize.
        from controller.learning.recognition.deck_watch import DeckWatch, joint_motions, teach_joints, unwind

        self._unwind = unwind
        measured = channel.output.measured()
        known = np.ones(len(joints), dtype=np.bool_) if measured is None else np.isfinite(measured[: len(joints)])
        self._order = np.flatnonzero(known)
        self._balls = np.searchsorted(self._order, balls[known[balls].all(1)])
        self._stops, self._channel = stop, channel
        self.names: Sequence[str] = library.network.motions
        motions = joint_motions(library, retarget)
        for name, targets in motions.items():
            motions[name] = np.clip(targets, limits.lower, limits.upper)[:, self._order]
            unwind(motions[name], self._balls)
        self._joints = [joints[joint] for joint in self._order.tolist()]
        self.watch = DeckWatch(teach_joints(motions), self._joints, rate, patience)
        self._targets, self._measured = np.zeros(len(self._order)), np.zeros(len(self._order))
        self._time = -1.0
        self._printed = 0
        self._stopped = False

    @property
    def seen(self) -> Recognized | None:
        """The motion that the joints look like, with its confidence; None while they stand still."""
        return Recognized(self.watch.seen, self.watch.confidence) if self.watch.seen is not None else None

    @property
    def mismatch_s(self) -> float:
        """For how long another motion than the commanded one has been recognized, s."""
        return self.watch.mismatch

    @property
    def stuck(self) -> str:
        """The joint that follows its targets least, if any does not."""
        stuck = self.watch.stuck
        return self._joints[int(stuck.argmax())] if stuck.any() else ""

    def update(self, state: LoopState, deck: PlayableDeck, stop: StopRequest) -> None:
        """Takes in one tick; an alarm is printed once, and ends the run if that is the policy."""
        played = stop.mode == "playing" and deck.time != self._time
        self._time = deck.time
        if self._channel.measured is None:
            return
        np.take(state.targets, self._order, out=self._targets)
        np.take(self._channel.measured, self._order, out=self._measured)
        self._unwind(self._targets, self._balls)
        self._unwind(self._measured, self._balls)
        settled = played and deck.settled
        for alarm in self.watch.update(self._targets, self._measured, deck.playing, settled=settled, at=deck.time):
            if self._stops and not stop:
                stop.ask(alarm.text)
                self._stopped = True
            if self._printed < MOST_PRINTED:
                self._printed += 1
                print(f"motiondeck: at {alarm.at:.1f} s {alarm.text}", file=sys.stderr)

    def report(self) -> dict[str, Any]:
        """Its part of the report of the run."""
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


Watch = BodyWatch | RecognitionWatch


def summary_lines(report: dict[str, Any]) -> list[str]:
    """The same as lines of a run's summary, or what a `BodyWatch` has seen."""
    if "shares" in report:
        most = [(played, *max(shares.items(), key=lambda one: one[1])) for played, shares in report["shares"].items()]
        return [f"while {played} was played, {seen} ({100.0 * share:.0f} %) was seen" for played, seen, share in most]
    share, after = report["right_share"], report["seen_after_s"]
    seen = f"the commanded motion was seen in {100.0 * share:.1f} % of the ticks" if share is not None else "nothing"
    when = f", {after:.2f} s after a switch had begun (median)" if after is not None else ""
    return [f"recognized from the joints: {seen}{when}; {report['raised']} alarms"]
