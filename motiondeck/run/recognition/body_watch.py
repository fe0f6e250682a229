"""`motiondeck play --recognizer FILE`: which of a saved recognizer's motions the played body shows."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from controller.loop.loop import LoopState
from controller.loop.stop_requests import StopRequest
from controller.motion.skeleton import Skeleton
from controller.wire.messages.deck_snapshot import DeckState, Recognized

if TYPE_CHECKING:
    from controller.learning.recognition.recognizer import Recognizer

MOST_KEPT = 1000  # times at which another motion was seen, the latest


class BodyWatch:
    """Feeds a `BodyRecognizer` with the poses from which the joints' targets are made.

    Args:
        recognizer: what knows the motions.
        skeleton: of the poses.

    Raises:
        MotiondeckError: if the skeleton lacks a joint that the recognizer looks at.
    """

    def __init__(self, recognizer: Recognizer, skeleton: Skeleton) -> None:
        from controller.learning.recognition.body_recognizer import BodyRecognizer

        self._body = BodyRecognizer(recognizer, skeleton)
        # Nothing is commanded that these motions could miss.
        self.mismatch_s, self.stuck = 0.0, ""
        self._time: float | None = None
        self._spent: Counter[tuple[str, str]] = Counter()  # ticks, by what was played and what was seen
        self._spans: deque[tuple[float, str]] = deque(maxlen=MOST_KEPT)

    @property
    def names(self) -> Sequence[str]:
        """The recognizer's motions."""
        return self._body.online.classes

    @property
    def seen(self) -> Recognized | None:
        """The recognized motion, with its confidence; None while none is certain."""
        return Recognized(self._body.seen, self._body.online.confidence) if self._body.seen is not None else None

    def update(self, state: LoopState, deck: DeckState, stop: StopRequest) -> None:
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
