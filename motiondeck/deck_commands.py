# pyright: strict
"""The commands of a deck as methods: the same for a live deck and for a deck that a program steps itself."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Generic, Literal, TypeVar

from controller.wire.messages import commands
from controller.wire.messages.arguments import HELD
from controller.wire.messages.commands import DeckCommand
from controller.wire.messages.deck_snapshot import LockState
from controller.wire.messages.replies import State as DeckStatus

Commanded = TypeVar("Commanded")


class DeckCommands(ABC, Generic[Commanded]):
    """Commands to a deck; `Commanded` describes a motion that a deck has been commanded to play."""

    __slots__ = ()

    @abstractmethod
    def _request(self, message: DeckCommand) -> object:
        """Carries out a command; its reply."""

    @abstractmethod
    def _commanded(self, message: DeckCommand) -> Commanded:
        """Carries out a command that plays a motion."""

    def status(self) -> DeckStatus:
        """What is played now, at which tempo, what is next, and the mode. MotiondeckError if a live deck has ended."""
        reply = self._request(commands.GetStatus())
        assert isinstance(reply, DeckStatus), "a status is answered by a state"
        return reply

    def switch(self, motion: str, *, direct: bool = False) -> Commanded:
        """Plays another motion now, or when the present one-shot has ended; the queue is cleared.

        With `direct` it switches at once, without motions in between. CommandError if it cannot be done now, or there
        is no such motion; it names the nearest. MotiondeckError if the deck has ended.
        """
        return self._commanded(commands.Switch(motion, direct=direct))

    def queue(self, motion: str) -> Commanded:
        """Plays a motion after what is played and queued; raises as `switch`."""
        return self._commanded(commands.Queue(motion))

    def blend(self, first: str, second: str, weight: float, also: Mapping[str, float] | None = None) -> Commanded:
        """Plays a blend of loops: `deck.blend("walk", "jog", 0.3)`, `deck.blend("walk", "jog", 0.3, {"waltz": 0.2})`.

        CommandError if they cannot be blended, and why; or as `switch`. MotiondeckError if the deck has ended.

        Args:
            first: the motion that has the rest of the weights, which sum to 1.
            second: a motion that is blended into it.
            weight: of the second, in [-0.3, 1.3].
            also: one or two further motions with their weights; then no weight is below 0 or above 1.
        """
        return self._commanded(commands.Blend(first, second, weight, also=tuple((also or {}).items())))

    @property
    def tempo(self) -> float:
        """The present tempo: 1 is as fast as recorded, 0 stands still, negative plays backwards.

        Setting it plays at another one, from -3 to 3, reached as quickly as is smooth. A library whose network has no
        phase refuses a negative one with a CommandError.
        """
        return self.status().tempo

    @tempo.setter
    def tempo(self, factor: float) -> None:
        self.set_tempo(factor)

    def set_tempo(self, factor: float, over: float = 0.0) -> None:
        """Plays at another tempo; the change takes `over` seconds, or as few as are smooth."""
        self._request(commands.SetTempo(factor, over=over))

    @property
    def phase(self) -> float | None:
        """The phase of the motion: [0, 1) in a loop, 0 to 1 in a one-shot; None if the network has none."""
        return self.status().phase

    def jump(self, phase: float) -> None:
        """Goes to a phase (0 to 1) of the motion by a transition. CommandError without a phase, or in a blend."""
        self._request(commands.Jump(phase))

    @property
    def inputs(self) -> dict[str, float]:
        """The present values of the inputs that motions have besides the phase, such as speed."""
        return self.status().inputs

    def set_input(self, name: str, value: float = 0.0, seconds: float = HELD) -> None:
        """Changes an input of motions within a second, or gives joints a live value.

        [How joints follow it](docs/deck.md#live-values). CommandError for an unknown name, or a value out of range.

        Args:
            name: of an input that motions have, of a joint or a group of joints, or "off", which ends all live values.
            value: of joints from -1 (their lower limit) over 0 (the angle 0) to 1 (their upper limit).
            seconds: how long joints are held without a further value.
        """
        self._request(commands.SetInput(name, value, seconds))

    def gaze(self, left: float, up: float, ahead: float = 1.0, seconds: float = HELD) -> None:
        """Looks at a point, in m from the eyes, for some seconds; CommandError if no joints are known to look with."""
        self._request(commands.Gaze(left, up, ahead, seconds))

    def layer(self, group: str, motion: str = "off", weight: float = 1.0, tempo: float = 1.0) -> None:
        """Plays a motion on a group of joints over the rest, with a weight from 0 to 1; "off" ends it, or all layers.

        CommandError for an unknown group or motion, or a robot that can have no layer.
        """
        self._request(commands.Layer(group, motion, weight, tempo))

    def lock(self, source: Literal["beat", "deck", "body", "person"], phase: float = 0.0, steps: int = 0) -> None:
        """Locks the phase to beats, another deck, the body or a person ([how](docs/deck.md#locks)).

        CommandError if the network runs by itself, or there is nothing of that kind to lock to.

        Args:
            source: "beat" for the times that `beat` is given, "body" for the measured joints, "deck" for the deck
                that `play` was given to lock to, "person" for what `follow` is given.
            phase: the phase that falls on a beat, or how far to be ahead of the other deck, from 0 to 1.
            steps: how many beats a round has, up to 16; 0 takes 1, 2, 4, 8 or 16, whichever tempo is nearest to 1.
        """
        self._request(commands.LockPhase(source, phase=phase, steps=steps))

    def follow(self, motion: str, phase: float, tempo: float = 1.0, ago: float = 0.0) -> None:
        """Says where a person was in a motion some seconds ago, and how fast; it counts after `lock("person")`."""
        self._request(commands.FollowPerson(motion, phase, tempo, ago))

    def unlock(self) -> None:
        """Plays at the commanded tempo again."""
        self._request(commands.Unlock())

    @property
    def locked_to(self) -> LockState | None:
        """What the phase is locked to: `source`, `state`, `error_ms` and `per_minute`; None without a lock."""
        return self.status().lock

    def pause(self) -> None:
        """Comes to a standstill."""
        self._request(commands.Pause())

    def resume(self) -> None:
        """Goes on after a pause, from home, or after the emergency stop was reset."""
        self._request(commands.Resume())

    def home(self) -> None:
        """Goes slowly to the rest pose and stays there until `resume` or a motion."""
        self._request(commands.Home())

    def emergency_stop(self) -> None:
        """Brakes every joint as hard as its limits allow and holds until `reset`."""
        self._request(commands.EmergencyStop())

    def reset(self) -> None:
        """Releases the emergency stop; nothing moves before `resume`, `switch` or `home`."""
        self._request(commands.Reset())
