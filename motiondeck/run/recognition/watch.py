"""What a session, its page and its report know of whatever recognizes motions while it runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from controller.loop.loop import LoopState
from controller.loop.stop_requests import StopRequest
from controller.wire.messages.deck_snapshot import Recognized


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


class Watch(Protocol):
    """Recognizes motions while they are played."""

    @property
    def names(self) -> Sequence[str]:
        """What it can see."""
        ...

    @property
    def seen(self) -> Recognized | None:
        """The recognized motion, with its confidence."""
        ...

    @property
    def mismatch_s(self) -> float:
        """For how long another motion than the commanded one has been recognized, s."""
        ...

    @property
    def stuck(self) -> str:
        """A joint that does not follow its targets, or ""."""
        ...

    def look(self, state: LoopState, deck: WatchedDeck, stop: StopRequest) -> None:
        """Takes in one tick; it may end the run."""
        ...

    def report(self) -> dict[str, Any]:
        """Its part of the report of the run."""
        ...
