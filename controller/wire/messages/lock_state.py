"""What the phase of a motion is locked to, and how well it keeps step."""

from __future__ import annotations

import math
from typing import Literal, get_args

import msgspec

LockSource = Literal["beat", "deck", "body"]
LockStage = Literal["searching", "locked", "waiting"]
LOCK_SOURCES: tuple[LockSource, ...] = get_args(LockSource)
LOCK_STAGES: tuple[LockStage, ...] = get_args(LockStage)


class LockState(msgspec.Struct, frozen=True):
    """What the phase is locked to.

    Attributes:
        source: beats, another deck, or the measured joints.
        state: "searching" before it is in step, "locked" when it is, "waiting" while the body is held.
        error_ms: how far the motion is behind, ms; of a body how far the body is; None if that is not known.
        per_minute: beats a minute, where there are beats.
    """

    source: LockSource
    state: LockStage
    error_ms: float | None = None
    per_minute: float | None = None

    def __str__(self) -> str:
        """In a few words, as in "locked to the beat of 120.0 a minute (+4 ms)"."""
        to = {"beat": "the beat", "deck": "another deck", "body": "the body"}[self.source]
        beat = f" of {self.per_minute:.1f} a minute" if self.per_minute is not None else ""
        off = f" ({self.error_ms:+.0f} ms)" if self.error_ms is not None else ""
        state = {"searching": "searching for", "locked": "locked to", "waiting": "waiting for"}[self.state]
        return f"{state} {to}{beat}{off}"


def lock_numbers(lock: LockState | None) -> dict[str, float]:
    """A lock as fields of telemetry and recordings: indices of LOCK_SOURCES and LOCK_STAGES, -1 for none, and ms."""
    if lock is None:
        return {"lock_source": -1.0, "lock_stage": -1.0, "lock_error_ms": math.nan}
    error = lock.error_ms if lock.error_ms is not None else math.nan
    return {
        "lock_source": float(LOCK_SOURCES.index(lock.source)),
        "lock_stage": float(LOCK_STAGES.index(lock.state)),
        "lock_error_ms": error,
    }
