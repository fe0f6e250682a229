"""The interface of motion recognition during a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from controller.loop.loop import LoopState
from controller.loop.stop_requests import StopRequest
from controller.wire.messages.deck_snapshot import DeckState, RecognitionState


class Watch(RecognitionState, Protocol):
    """Recognizes motions while they are played."""

    @property
    def names(self) -> Sequence[str]:
        """The motions that it knows."""
        ...

    def update(self, state: LoopState, deck: DeckState, stop: StopRequest) -> None:
        """Takes in one tick; it may end the run."""
        ...

    def report(self) -> dict[str, Any]:
        """Its part of the report of the run."""
        ...
