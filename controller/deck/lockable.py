"""A deck whose tempo a lock can steer."""

from abc import ABC, abstractmethod
from collections.abc import Callable

from controller.deck.locks.body_lock import BodyLock, Measured
from controller.deck.locks.phase_lock import Beats, Leader, LoopPlace, OtherDeck, Person, PhaseLock
from controller.deck.tempo import TEMPO_RATE, Paced
from controller.motion.rotations import Array
from controller.wire.messages.arguments import AGO, PHASE, STEPS
from controller.wire.messages.deck_snapshot import LockSource, LockState
from motiondeck_base.errors import MotiondeckError


class Lockable(Paced, ABC):
    """The locks of a deck."""

    time: float  # s since the start, summed over updates
    # Returns the due time of the present tick by the machine's steady clock, s; locks follow it, since beats and other
    # decks go on while ticks are missed. Without it they follow the time of the deck.
    due: Callable[[], float] | None = None
    lead: float = 0.0  # how far the deck runs ahead of its joints, s; locks are kept where the joints are
    phase_at: float | None = None  # when the joints are due at the present phase, by that clock, s; None without one
    leader: Leader | None = None  # observes the deck that this one can be locked to, or None
    measured: Measured | None = None  # returns the measured joint positions, or None where there are none

    def __init__(self) -> None:
        super().__init__()
        self._lock: BodyLock | PhaseLock | None = None

    @property
    def lock_state(self) -> LockState | None:
        """The state of the lock, or None without one."""
        return self._lock.state if self._lock is not None else None

    @abstractmethod
    def require_phase(self) -> None:
        """Checks that the network has a phase; MotiondeckError if it runs by itself."""

    @abstractmethod
    def _playhead(self, time: float) -> LoopPlace | None:
        """The place in the motion at the latest update, at `time` s; None for an autonomous network."""

    def lock(self, source: LockSource, phase: float = 0.0, steps: int = 0) -> None:
        """Locks the phase of loops, to a person also of one-shots, to a reference; an earlier lock ends.

        CommandError if a number is out of its range. MotiondeckError if the network runs by itself, or there is no such
        source here.

        Args:
            source: "beat" for the times that `beat` is given, "deck" for the `leader`, "body" for what is `measured`,
                "person" for what `follow` is given.
            phase: the phase that falls on a beat, or how far to be ahead of the other deck, in [0, 1].
            steps: how many beats a round has, up to 16; 0 takes 1, 2, 4, 8 or 16, whichever tempo is nearest to 1.
        """
        PHASE.check(phase)
        STEPS.check(steps)
        self.require_phase()
        if source == "body":
            if self.measured is None:
                raise MotiondeckError("this deck has no joints that are measured")
            self._lock = BodyLock(self.measured)
        elif source == "deck":
            if self.leader is None:
                raise MotiondeckError("this deck sees no other deck; start it with: motiondeck play --lock-to PORT")
            self._lock = PhaseLock(OtherDeck(self.leader, phase), TEMPO_RATE)
        else:
            self._lock = PhaseLock(Person() if source == "person" else Beats(phase, steps), TEMPO_RATE)

    def unlock(self) -> None:
        """Plays at the commanded tempo again."""
        self._lock = None
        super().set_tempo(self.commanded_tempo)

    @property
    def _source(self) -> Beats | OtherDeck | Person | None:
        return self._lock.source if isinstance(self._lock, PhaseLock) else None

    def beat(self, ago: float = 0.0) -> None:
        """Takes a beat of `ago` seconds ago, from -2 (still to come) to 2; without a lock to beats it begins one.

        CommandError if the time is out of its range. MotiondeckError if the network runs by itself.
        """
        AGO.check(ago)
        if not isinstance(self._source, Beats):
            self.lock("beat")
        beats = self._source
        assert isinstance(beats, Beats), "locked to beats"
        beats.clock.beat(self._clock() - ago)

    def _clock(self) -> float:
        return self.due() if self.due is not None else self.time

    def set_tempo(self, factor: float, over: float = 0.0) -> None:
        """Plays at another tempo, reached within `over` seconds; it ends a lock to beats or to another deck."""
        super().set_tempo(factor, over)
        if isinstance(self._lock, PhaseLock):
            self._lock = None

    def _note(self, targets: Array) -> None:
        if isinstance(self._lock, BodyLock) and (playhead := self._playhead(self.time)) is not None:
            self._lock.note(playhead, targets)

    def _steer(self, dt: float) -> tuple[float, float | None]:
        """The tempo after dt more seconds, as commanded or as a lock wants it, and a phase to jump to, if it wants one.

        It is called before the deck advances by them. Where it is now it should have been one update before this one is
        due: however many were missed, the lock sees all of what it has fallen behind.
        """
        if self.due is not None:
            self.phase_at = self.due() + self.lead
        time = self.phase_at - dt if self.phase_at is not None else self.time + self.lead
        if self._lock is None or (playhead := self._playhead(time)) is None:
            return self.advance_tempo(dt), None
        tempo, jump = self._lock.steer(playhead)
        return self.steer_tempo(tempo, self._lock.rate, dt), jump
