"""Counts the exceptions of a call that must not stop the loop, and gives the call up when it keeps failing."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ParamSpec

from motiondeck_base.errors import in_words

P = ParamSpec("P")

FAULTS_TO_GIVE_UP = 20


@dataclass
class FaultCounter:
    """The faults of one kind of call."""

    faults: int = 0
    fault: str = ""
    given_up: bool = False  # whether the last `most` calls have all raised; no further one is made
    most: int = FAULTS_TO_GIVE_UP
    _in_a_row: int = 0

    def call(self, action: Callable[P, None], *args: P.args, **kwargs: P.kwargs) -> None:
        """Calls the action and counts what it raises, unless given up."""
        if self.given_up:
            return
        try:
            action(*args, **kwargs)
        except Exception as error:
            self.faults += 1
            self._in_a_row += 1
            self.given_up = self._in_a_row >= self.most
            self.fault = in_words(error)
        else:
            self._in_a_row = 0
