"""The decks that a conductor has seen: their state, the cues sent to them, and what they lack for a condition."""

from collections.abc import Callable
from dataclasses import dataclass, field

from controller.wire.messages.commands import Blend, DeckCommand, Home, Jump, Pause, Push, Resume, Stop, Switch
from motiondeck.shows.messages import About, CommonRound, DeckHealth, TimedCue
from motiondeck.shows.show_file import ALL, Condition, Show, wrong_motions
from motiondeck_base.errors import MotiondeckError, UnknownNameError

SILENT_AFTER = 1.0  # a deck whose health is older than this is not counted on, s


class CueSum:
    """The sum of all cues of a deck: the commands for one that joins late or has missed some."""

    def __init__(self) -> None:
        self.number = 0
        self.at = 0.0  # when it is carried out, in the conductor's time, s
        self._commands: list[DeckCommand] = []
        self._step: CommonRound | None = None

    def take(self, cue: TimedCue) -> None:
        """Takes a cue that was sent."""
        self.number, self.at = cue.number, cue.at
        for command in cue.say:
            if isinstance(command, Switch | Blend | Home | Stop):  # nothing before it matters any more
                self._commands, self._step = [], None
            if isinstance(command, Pause | Resume):
                self._commands = [before for before in self._commands if not isinstance(before, Pause | Resume)]
            if not isinstance(command, Jump | Push | Stop):
                self._commands.append(command)
        if cue.step is not None:
            self._step = cue.step

    def cue(self, run: str, deck: str, at: float) -> TimedCue:
        """The cue that brings a deck there."""
        return TimedCue(run, self.number, "joins", at, [deck], list(self._commands), self._step)


@dataclass
class SeenDeck:
    """A deck as the conductor knows it."""

    name: str
    here: bool = False
    about: About | None = None  # its latest message about itself; None before the first
    health: DeckHealth | None = None  # its latest state; None before the first
    heard: float = 0.0  # time of its health, s
    cues: CueSum = field(default_factory=CueSum)  # the sum of the cues sent to it
    joined: float = 0.0  # when that was last sent, s
    problems: int = 0
    losses: int = 0


class SeenDecks:
    """All decks that a conductor has seen; what happens is passed to `notify` as lines of text."""

    def __init__(self, show: Show, run: str, notify: Callable[[str], None], now: Callable[[], float]) -> None:
        self._show, self._run, self._notify, self._now = show, run, notify, now
        self._sent: list[tuple[list[str], TimedCue]] = []
        self.by_name: dict[str, SeenDeck] = {}

    def __getitem__(self, name: str) -> SeenDeck:
        """A deck; one that is new has missed what was sent to all or to its groups."""
        deck = self.by_name.get(name)
        if deck is None:
            deck = self.by_name[name] = SeenDeck(name)
            for names, cue in self._sent:
                if name in self._show.members(names, [name]):
                    deck.cues.take(cue)
        return deck

    @property
    def present(self) -> list[SeenDeck]:
        """Those that are connected."""
        return [deck for deck in self.by_name.values() if deck.here]

    @property
    def present_names(self) -> list[str]:
        """Their names."""
        return [deck.name for deck in self.present]

    def named(self, names: list[str]) -> list[str]:
        """The decks of some names; UnknownNameError has the nearest name, MotiondeckError if none of them is here."""
        present = self.present_names
        known = [*dict.fromkeys([*present, *self._show.decks]), *self._show.groups, ALL]
        for name in names:
            UnknownNameError.check("deck", name, known)
        decks = self._show.members(names, present)
        if not set(decks) & set(present):
            raise MotiondeckError(f"not here: {', '.join(decks)}" if decks else "no deck is here yet")
        return decks

    def see(self, name: str, *, here: bool) -> None:
        """Notes that a deck has come or gone."""
        deck = self[name]
        deck.here = here
        if not here:
            deck.health = None
            deck.losses += 1
            self._notify(f"{name} is gone")

    def introduce(self, name: str, about: About) -> None:
        """Records the description of a deck."""
        self[name].about = about
        self._notify(f"{name} is here: {about.robot}, {about.library}")
        for problem in wrong_motions(self._show, {name: about.rounds}):
            self._notify(f"{self._show.show}: {problem}")

    def note_health(self, name: str, health: DeckHealth) -> None:
        """Records the health of a deck, and reports a new problem."""
        deck = self[name]
        deck.health, deck.heard = health, self._now()
        if health.problems > deck.problems:
            self._notify(f"{name}: {health.problem}")
        deck.problems = health.problems

    def note_sent(self, cue: TimedCue, to: list[str]) -> None:
        """Notes a cue that was sent to its decks, and is for all of these names, decks that come later too."""
        for deck in cue.decks:
            self[deck].cues.take(cue)
        self._sent.append((to, cue))

    def forget_sent(self) -> None:
        """Forgets all cues that were sent."""
        self._sent.clear()
        for deck in self.by_name.values():
            deck.cues = CueSum()

    def lacking(self, condition: Condition, receivers: list[str]) -> list[str]:
        """What a condition lacks, deck by deck."""
        decks = self._show.members(receivers, self.present_names)
        lacks = [f"{name} {lack}" for name in decks if (lack := self._lack(condition, self.by_name.get(name)))]
        return lacks if decks else ["no deck is here"]

    def _lack(self, condition: Condition, deck: SeenDeck | None) -> str:
        if deck is None or not deck.here:
            return "is not here"
        health = deck.health
        if health is None or self._now() - deck.heard > SILENT_AFTER:
            return "says nothing"
        if health.clock is None:
            return "does not know the time yet"
        current = (health.run, health.cue) == (self._run, deck.cues.number) or not deck.cues.number
        if condition != "here" and (not current or health.switching):
            return "is switching"
        return "is not in step" if condition == "in step" and not health.lock.startswith("locked") else ""
