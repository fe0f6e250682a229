"""What the phase of a motion is locked to, and how well it keeps step."""

from typing import Literal, get_args

import msgspec

LockSource = Literal["beat", "deck", "body", "person"]
LockStage = Literal["searching", "locked", "waiting"]
LOCK_SOURCES: tuple[LockSource, ...] = get_args(LockSource)


class LockState(msgspec.Struct, frozen=True):
    """What the phase is locked to."""

    source: LockSource
    state: LockStage  # "searching" before it is in step, "locked" when it is, "waiting" while the body is held
    # How far the motion is behind, ms; of a body how far the body is; None if that is not known.
    error_ms: float | None = None
    per_minute: float | None = None

    def __str__(self) -> str:
        """In a few words, as in "locked to the beat of 120.0 a minute (+4 ms)"."""
        to = {"beat": "the beat", "deck": "another deck", "body": "the body", "person": "a person"}[self.source]
        beat = f" of {self.per_minute:.1f} a minute" if self.per_minute is not None else ""
        off = f" ({self.error_ms:+.0f} ms)" if self.error_ms is not None else ""
        state = {"searching": "searching for", "locked": "locked to", "waiting": "waiting for"}[self.state]
        return f"{state} {to}{beat}{off}"
