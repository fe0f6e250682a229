"""Snapshots of a run, taken from its parts."""

# ruff: noqa: D102 (`DeckSnapshot` says what the properties of the protocol are)

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from controller.loop.commands.interfaces import PlayableDeck, Pushable
from controller.loop.loop import LoopState
from controller.loop.stop_requests import StopRequest
from controller.wire.messages.deck_snapshot import NO_HEALTH, BlendPart, DeckSnapshot, Recognized, TickHealth


class RecognitionState(Protocol):
    """Recognition during a run; see `DeckSnapshot`."""

    @property
    def seen(self) -> Recognized | None: ...
    @property
    def mismatch_s(self) -> float: ...
    @property
    def stuck(self) -> str: ...


@dataclass
class SnapshotSource:
    """The parts of a run that its snapshots are taken from; only the deck is needed."""

    deck: PlayableDeck
    body: Pushable | None = None
    recognition: RecognitionState | None = None
    kept_apart: Callable[[], int] | None = None  # counts the ticks in which limbs were kept from colliding
    loop: LoopState | None = None
    health: TickHealth | None = NO_HEALTH  # the last percentiles; None, set now and then, has the next take them

    def take(self, run: StopRequest | None = None) -> DeckSnapshot:
        """The present state of a run in this mode."""
        deck, loop, recognition = self.deck, self.loop, self.recognition
        if self.health is None and loop is not None:
            late, work = loop.lateness.percentiles(), loop.work.percentiles()
            self.health = TickHealth(late.p50, late.p999, work.p50) if loop.tick else TickHealth()
        return DeckSnapshot(
            motion=deck.motion,
            playing=deck.playing,
            way=tuple(deck.way),
            queue=deck.queue,
            blend=tuple(map(BlendPart._make, deck.blend)),
            fell_back=deck.fell_back,
            tempo=deck.tempo,
            commanded_tempo=deck.commanded_tempo,
            phase=deck.phase,
            inputs=deck.inputs,
            layers=deck.layered,
            lock=deck.lock_state,
            paused=deck.paused,
            switching=not deck.settled,
            restarts=deck.restarts,
            at=deck.time,
            mode=run.mode if run is not None else "playing",
            approaching=run is not None and run.approaching,
            fallen=self.body is not None and self.body.fallen,
            seen=recognition.seen if recognition is not None else None,
            mismatch_s=recognition.mismatch_s if recognition is not None else 0.0,
            stuck=recognition.stuck if recognition is not None else "",
            kept_apart=self.kept_apart() if self.kept_apart is not None else 0,
            tick=loop.tick if loop is not None else 0,
            run_s=loop.seconds if loop is not None else 0.0,
            clock_s=1e-9 * loop.began_ns if loop is not None else 0.0,
            late_us=1e-3 * loop.late_ns if loop is not None else 0.0,
            work_us=1e-3 * loop.work_ns if loop is not None else 0.0,
            overruns=loop.overruns if loop is not None else 0,
            rate_hz=loop.rate if loop is not None else 0.0,
            health=self.health or NO_HEALTH,
        )
