"""The decks that a conductor has seen: what they say of themselves, what was sent to them, and what they lack."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from motiondeck.shows.messages import About, DeckHealth, TimedCue
from motiondeck.shows.show_file import ALL, Condition, Show, wrong_motions
from motiondeck.shows.standing import Standing
from motiondeck_base.errors import MotiondeckError, UnknownNameError

SILENT_AFTER = 1.0
"""A deck whose health is older than this is not counted on, s."""


@dataclass
class SeenDeck:
    """What the conductor knows of a deck.

    Attributes:
        name: of the deck.
        here: whether it is connected.
        about, health: what it says of itself; None before that.
        heard: when its health came, s.
        standing: what it should be doing.
        joined: when it was last given that, s.
        problems: how many have been told.
        losses: how often its connection was lost.
    """

    name: str
    here: bool = False
    about: About | None = None
    health: DeckHealth | None = None
    heard: float = 0.0
    standing: Standing = field(default_factory=Standing)
    joined: float = 0.0
    problems: int = 0
    losses: int = 0


class SeenDecks:
    """All of them.

    Args:
        show: that they take part in.
        run: of the conductor.
        tell: is told what happens.
        now: the clock of the show, s.

    Attributes:
        by_name: each by its name.
    """

    def __init__(self, show: Show, run: str, tell: Callable[[str], None], now: Callable[[], float]) -> None:
        self._show, self._run, self._tell, self._now = show, run, tell, now
        self._sent: list[tuple[list[str], TimedCue]] = []
        self.by_name: dict[str, SeenDeck] = {}

    def __getitem__(self, name: str) -> SeenDeck:
        """A deck; one that is new has missed what was sent to all or to its groups."""
        deck = self.by_name.get(name)
        if deck is None:
            deck = self.by_name[name] = SeenDeck(name)
            for names, cue in self._sent:
                if name in self._show.members(names, [name]):
                    deck.standing.take(cue)
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
        """The decks of some names, of which at least one is here.

        Raises:
            UnknownNameError: if there is no such deck or group; it names the nearest.
            MotiondeckError: if none of them is here.
        """
        present = self.present_names
        known = [*dict.fromkeys([*present, *self._show.decks]), *self._show.groups, ALL]
        for name in names:
            if name not in known:
                raise UnknownNameError.among("deck", name, known)
        decks = self._show.members(names, present)
        if not set(decks) & set(present):
            raise MotiondeckError(f"not here: {', '.join(decks)}" if decks else "no deck is here yet")
        return decks

    def check_plays(self, name: str, motion: str) -> None:
        """Checks that a deck has a motion, as far as that is known.

        Raises:
            UnknownNameError: if not; it names the nearest.
        """
        about = self[name].about
        if about is not None and motion not in about.rounds:
            raise UnknownNameError(f"{name}: {UnknownNameError.among('motion', motion, about.rounds)}")

    def round_of(self, motions: list[str], decks: list[str]) -> float | None:
        """How long a round takes of the first of some motions of which a deck knows it, s."""
        for motion in motions:
            for name in decks:
                about = self[name].about
                if about is not None and (seconds := about.rounds.get(motion, 0.0)) > 0.0:
                    return seconds
        return None

    def see(self, name: str, *, here: bool) -> None:
        """Notes that a deck has come or gone."""
        deck = self[name]
        deck.here = here
        if not here:
            deck.health = None
            deck.losses += 1
            self._tell(f"{name} is gone")

    def introduce(self, name: str, about: About) -> None:
        """Notes what a deck says of itself."""
        self[name].about = about
        self._tell(f"{name} is here: {about.robot}, {about.library}")
        for problem in wrong_motions(self._show, {name: about.rounds}):
            self._tell(f"{self._show.show}: {problem}")

    def note_health(self, name: str, health: DeckHealth) -> None:
        """Notes how a deck is, and tells a new problem of its."""
        deck = self[name]
        deck.health, deck.heard = health, self._now()
        if health.problems > deck.problems:
            self._tell(f"{name}: {health.problem}")
        deck.problems = health.problems

    def note_sent(self, cue: TimedCue, to: list[str]) -> None:
        """Notes a cue that was sent to its decks, and is for all of these names, decks that come later too."""
        for deck in cue.decks:
            self[deck].standing.take(cue)
        self._sent.append((to, cue))

    def forget_sent(self) -> None:
        """From now on nothing stands."""
        self._sent.clear()
        for deck in self.by_name.values():
            deck.standing = Standing()

    def lacking(self, condition: Condition, receivers: list[str]) -> list[str]:
        """What a condition lacks, deck by deck."""
        decks = self._show.members(receivers, self.present_names)
        lacks = [f"{name} {lack}" for name in decks if (lack := self._lack(condition, self.by_name.get(name)))]
        return lacks if decks else ["no deck is here"]

    def _lack(self, condition: Condition, deck: SeenDeck | None) -> str:
        """What a deck lacks for a condition; "" for nothing."""
        if deck is None or not deck.here:
            return "is not here"
        health = deck.health
        if health is None or self._now() - deck.heard > SILENT_AFTER:
            return "says nothing"
        if health.clock is None:
            return "does not know the time yet"
        current = (health.run, health.cue) == (self._run, deck.standing.number) or not deck.standing.number
        if condition != "here" and (not current or health.switching):
            return "is switching"
        return "is not in step" if condition == "in step" and not health.lock.startswith("locked") else ""
