"""The worst join of a library: the largest speed and acceleration of joints at the hardest of its switches.

To play every pair at every phase takes minutes. The joins that look hardest are found in the stored motions: those
whose bodies are farthest apart, in place and velocity, for how briskly the two motions move themselves. The deck plays
a few of them and measures them.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import product

import msgspec
import numpy as np

from controller.deck.deck import Deck
from controller.deck.joins.deck_motions import Motion, read_motion, read_motions
from controller.deck.joins.join_limits import FASTEST, HARDEST
from controller.deck.performance import VELOCITY_REACH, Joining
from controller.deck.routes import Routes
from controller.deck.switch import CommandedSwitch
from controller.library.motion_library import MotionInfo, MotionLibrary
from controller.motion.rotations import Array
from motiondeck_base.arrays_on_disk import on_disk, release

PHASES = 24  # at how many places a loop is left
PLAYED = 12  # how many of the joins that look hardest are played
RATE = 200.0  # Hz
_BEFORE, _AFTER = 3, 10  # ticks before the command, and after the switch has settled
_LONGEST = 4.0  # s
NOW = np.zeros(1)  # s


@dataclass(frozen=True)
class Join:
    """One switch."""

    source: str
    target: str
    phase: float  # where the source is left, [0, 1] of it
    speed: float  # the largest of any joint in the world, over the larger of both motions' own
    acceleration: float  # likewise
    seconds: float  # until nothing of the source was left

    @property
    def passes(self) -> bool:
        """Whether it stays within the limits of a join."""
        return self.speed <= FASTEST and self.acceleration <= HARDEST

    @property
    def use(self) -> float:
        """How much of these limits it needs; 1 is the limit."""
        return max(self.speed / FASTEST, self.acceleration / HARDEST)


def worst_join(library: MotionLibrary, *, phases: int = PHASES, played: int = PLAYED) -> Join | None:
    """The worst of the joins that look hardest, as the deck plays them; None where nothing can be joined."""
    joins = [play_join(_with_only(library, *one[:2]), *one) for one in hardest_joins(library, played, phases)]
    return max(joins, key=lambda join: join.use, default=None)


def hardest_joins(library: MotionLibrary, count: int, phases: int = PHASES) -> list[tuple[str, str, float]]:
    """The joins that look hardest, hardest first: source, target and the phase at which the source is left."""
    # At most one join is taken of each pair that is joined directly. One-shots are left at their end, loops at a number
    # of `phases`.
    motions = {info.name: _ends(library, info) for info in library.info.motions}
    routes = Routes.between(motions) if library.info.baked is None else Routes.of(library)
    found: list[tuple[float, tuple[str, str, float]]] = []
    exits = {name: _exits(motion, phases) for name, motion in motions.items()}
    for leaving, entering in product(motions.values(), repeat=2):
        if leaving is entering:
            release()
        if routes.way(leaving.name, entering.name) or (leaving is entering and leaving.loop):
            continue
        phase, places, velocities = exits[leaving.name]
        apart = _apart(places, velocities, entering) / max(leaving.acceleration, entering.acceleration)
        hardest = int(apart.argmax())
        found.append((float(apart[hardest]), (leaving.name, entering.name, float(phase[hardest]))))
    return [join for _, join in sorted(found, reverse=True)[:count]]


def play_join(
    library: MotionLibrary,
    source: str,
    target: str,
    phase: float,
    joining: Joining | None = None,
    *,
    direct: bool = False,
) -> Join:
    """One join as the deck plays it, measured from the command until the switch has settled."""
    run = MeasuredDeck(library, source, phase, joining, direct=direct)
    return run.until_settled(run.deck.switch(target), source, phase)


class MeasuredDeck:
    """A deck that keeps the places of its joints in the world; it begins at a phase, [0, 1]."""

    def __init__(
        self, library: MotionLibrary, motion: str, phase: float = 0.0, joining: Joining | None = None, *, direct: bool
    ) -> None:
        # The deck, which has played a few ticks.
        self.deck = Deck(
            library, lambda pose: pose.root_position, motion, direct=direct, joining=joining, phase=min(phase, 0.999)
        )
        self.places: list[Array] = []  # of the joints, a row (joints, 3) a tick, m
        self._skeleton, self._motions = library.skeleton, read_motions(library)
        self.play(_BEFORE)

    def play(self, ticks: int) -> None:
        """Goes on for some ticks."""
        for _ in range(ticks):
            _, pose = self.deck.update(1.0 / RATE)
            self.places.append(self._skeleton.joints(pose.root_position, pose.rotation))

    def until_settled(self, switch: CommandedSwitch, source: str, phase: float) -> Join:
        """Plays a switch from a motion until it has settled, and measures it."""
        while switch.settled_s is None and self.deck.time - switch.commanded_s < _LONGEST:
            self.play(1)
        seconds = self.deck.time - switch.commanded_s
        self.play(_AFTER)
        blended = [name for name, _ in switch.blend]
        target = " + ".join(blended) or switch.to
        return Join(source, target, phase, *self.peaks((source, *switch.via, switch.to, *blended)), seconds)

    def peaks(self, motions: Iterable[str], begin: int = 0) -> tuple[float, float]:
        """The largest speed and acceleration of a joint from a tick on, over the larger of these motions' own."""
        step = np.diff(self.places[begin:], axis=0)
        speed = float(np.linalg.norm(step, axis=-1).max()) * RATE
        acceleration = float(np.linalg.norm(np.diff(step, axis=0), axis=-1).max()) * RATE**2
        own = [self._motions[name] for name in motions]
        return speed / max(motion.speed for motion in own), acceleration / max(motion.acceleration for motion in own)


def _ends(library: MotionLibrary, info: MotionInfo) -> Motion:
    """A motion without its course, which is many times as large."""
    motion = read_motion(library, info)
    library.network.rest()
    first = {"course": motion.course[:1].copy(), "postures": motion.postures_ahead(NOW, 1.0)}
    every = {name: on_disk(getattr(motion, name)) for name in ("places", "velocities", "exits")}
    return replace(motion, **first, **every)


def _with_only(library: MotionLibrary, *names: str) -> MotionLibrary:
    """A library of some of the motions, where its network can be taken apart."""
    if library.info.baked is not None:
        return library
    network = library.network.only(names)
    kept = [info for info in library.info.motions if info.name in network.motions]
    return MotionLibrary(msgspec.structs.replace(library.info, motions=kept), network, library.encoding)


def _exits(motion: Motion, phases: int) -> tuple[Array, Array, Array]:
    """Phases (P,) at which a motion is left, with the places (P, F), m, and velocities (P, F), m/s, of its joints."""
    if not motion.loop:
        return np.ones(1), motion.exits, np.zeros_like(motion.exits)
    anchors = np.unique(np.arange(phases) * len(motion.places) // phases)
    return anchors / len(motion.places), motion.places[anchors], motion.velocities[anchors]


def _apart(places: Array, velocities: Array, entering: Motion) -> Array:
    """How far bodies (P, F) are from where a motion resembles them most, in place and velocity, shape (P,), m."""
    here = np.hstack([places, VELOCITY_REACH * velocities])
    there = np.hstack([entering.places, VELOCITY_REACH * entering.velocities])
    squares = np.square(here).sum(1)[:, None] + np.square(there).sum(1) - 2.0 * here @ there.T
    return np.sqrt(np.maximum(squares.min(1), 0.0))
