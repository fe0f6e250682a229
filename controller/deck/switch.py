"""A commanded switch and its progress."""

from dataclasses import dataclass

from controller.wire.messages.arguments import described


@dataclass(slots=True)
class CommandedSwitch:
    """A commanded switch; times are s since the deck's start, None while still to come."""

    to: str  # the motion
    commanded_s: float  # when it was commanded
    first_change_s: float | None = None  # the first tick whose targets it changed
    settled_s: float | None = None  # when it was complete
    after: str = ""  # the one-shot that is finished first, or ""
    via: tuple[str, ...] = ()  # the motions on the way
    overtaken: bool = False  # whether another command came before it had settled
    # The motions that are blended in once `to` is playing, each with its weight.
    blend: tuple[tuple[str, float], ...] = ()
    fell_back: str = ""  # why the blend was given up and what is played instead, or ""

    @property
    def destination(self) -> str:
        """What is played when it has settled, for a person."""
        return described(self.to, self.blend)
