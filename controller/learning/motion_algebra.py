"""Motions computed from others by their conceptors: morphs, extrapolation, AND, OR and NOT.

Where V and W_out are those of all motions, a conceptor C and a mean state m are a motion. An expression gives both:

    walk & waltz,  walk | waltz,  ~jog            AND, OR, NOT (Jaeger 2014, section 3.9)
    0.5 walk + 0.5 waltz,  1.2 walk - 0.2 jog     C = sum_i w_i C_i, sum_i w_i = 1 (Deliallisi 2017, eq. 3.16)

m and the logarithm of the period are mixed by the same w_i; by AND and OR evenly, of the motions that are not negated.
What C_i lost when it was cut to k directions counts as let through by FLOOR: without it no two motions have an AND.

C then lets through less than what it is made of. Its aperture is multiplied by the factor that lets it move most
without a larger jerk than its motions have. And where they point a bone opposite ways, its mixed direction would pass
near zero and the bone turn over at once. There m leans: by the least d for which W_out d moves these bones aside, V d
is 0, and d has no part in C's directions.
"""

import re
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, cast

import msgspec
import numpy as np

from controller.learning.fit import describe_motion
from controller.learning.measures.disturbance import stress_test
from controller.learning.measures.self_test import Judge, self_test
from controller.learning.recipe import MotionRecipe, check_name
from controller.library.motion_library import MotionLibrary
from controller.motion.encodings.bone_directions import FIRST_BONE
from controller.motion.encodings.encoding import Encoding
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.rotations import Array
from controller.networks.base import AnyNetwork
from controller.networks.phase_conceptor.network import PhaseConceptorMotion, StoredPieces
from controller.networks.reservoirs.conceptor_algebra import adapt_aperture, conjunction, disjunction, negation
from controller.networks.reservoirs.phase_reservoir import ANCHOR_EVERY, PhaseCourse
from motiondeck_base.errors import MotiondeckError, UnknownNameError

FLOOR = 0.1
APERTURES = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0)
LIVELIEST = 1.1  # times as fast as its motions, at most, where the aperture is chosen
STILL, HARDEST = 0.25, 1.5  # what moves less, or jerks more, than this many times what it is made of fails
SHORTEST, LONGEST = 0.2, 60.0  # s of a round
CLEAR = 0.4  # of the length of a direction: nearer to zero the bone leans aside
LEANS, LEAN_ROUNDS = (0.15, 0.3, 0.5, 0.7), 3
_CUBE = np.array([w for w in np.ndindex(3, 3, 3) if w != (1, 1, 1)]) - 1.0
_WAYS = _CUBE / np.linalg.norm(_CUBE, axis=1, keepdims=True)


@dataclass(frozen=True)
class ComputedMotion:
    """A library with one more motion, its last, computed from others."""

    library: MotionLibrary
    activity: float  # speed of its joints over the mean of its motions in step, root mean square
    jerk: float  # the largest of a joint, over the largest of its motions
    aperture: float  # the factor of its aperture
    similarity: dict[str, float]  # of its conceptor to that of each motion of one piece, 0 to 1


def compute_motion(library: MotionLibrary, expression: str, name: str) -> ComputedMotion:
    """Adds the motion of an expression to a library, which plays it to judge it.

    MotiondeckError if the name is taken, the expression cannot be read, or the network's motions share no W_out.
    """
    info, network = library.info, library.network
    check_name(name, Path(info.name))
    if name in network.motions:
        raise MotiondeckError(f"there is a motion '{name}' in the library '{info.name}' already; give another name")
    part, activity, jerk, factor = play_mixed(library, mixed_conceptor(network, expression))
    grown = cast(Any, network).with_motions({name: part})
    frames = part.read()
    judge = Judge(library.encoding, {name: frames}, {name: True}, info.rate)
    verdict = stress_test(grown, self_test(grown, judge), judge, info.seed)[name]
    described = describe_motion(MotionRecipe(name=name, file=expression), frames, grown, verdict, ANCHOR_EVERY)
    if described.passed and not (activity >= STILL and jerk <= HARDEST):
        reason = f"moves {activity:.2f} and jerks {jerk:.2f} times as much as its motions"
        described = msgspec.structs.replace(described, passed=False, reason=reason)
    info = msgspec.structs.replace(info, motions=[*info.motions, described])
    found = MotionLibrary(info, grown, library.encoding)
    return ComputedMotion(found, activity, jerk, factor, similarities(grown, name))


def similarities(network: AnyNetwork, motion: str) -> dict[str, float]:
    """The similarity of a motion's conceptor to those of the others of one piece (`conceptor_algebra.similarity`)."""
    parts = {one: network[one].stored for one in network.motions if len(network[one].stored.mean) == 1}
    own, found = parts.pop(motion), dict[str, float]()
    directions, size = own.basis[0].T, np.linalg.norm(own.strength)
    for one, other in parts.items():
        shared = np.square(directions @ other.basis[0])
        found[one] = float(own.strength[0] @ shared @ other.strength[0] / (size * np.linalg.norm(other.strength)))
    return found


@dataclass(frozen=True)
class MixedConceptor:
    """A conceptor B C B' that was computed from others: B orthonormal (N, q), C (q, q), and the shares of their m."""

    directions: Array
    matrix: Array
    shares: dict[str, float]  # which sum to 1


def mixed_conceptor(network: AnyNetwork, expression: str) -> MixedConceptor:
    """The conceptor of an expression; MotiondeckError if it cannot be read, or no motions share V and W_out."""
    if not (motions := network.mixable):
        raise MotiondeckError(
            "the motions of this library share no readout, by which others could be computed from them. "
            'Train them with type = "shared-conceptor" and readout = "shared" (the page "The networks").'
        )
    tokens = re.findall(r"[()&|~]|[^\s()&|~]+", expression)
    used = {name: part for name, part in motions.items() if name in tokens}
    directions, terms = _terms(used)
    term = _Reading(expression, tokens, terms, network).whole()
    shares = dict(zip(used, (term.own / term.own.sum()).tolist(), strict=True))
    return MixedConceptor(directions, term.matrix[:-1, :-1], shares)


def play_mixed(library: MotionLibrary, mixed: MixedConceptor) -> tuple[PhaseConceptorMotion, float, float, float]:
    """The motion of a conceptor of a library, its activity, jerk and aperture as `ComputedMotion` has them.

    MotiondeckError if its period is impossible.
    """
    own: list[PhaseConceptorMotion] = [library.network[one] for one in mixed.shares]
    rate, shares = library.info.rate, np.array([*mixed.shares.values()])
    seconds = float(np.exp(np.minimum(shares @ np.log([len(part) for part in own]), 50.0))) / rate
    if not SHORTEST <= seconds <= LONGEST:
        raise MotiondeckError(f"a round would take {seconds:.3g} s; {SHORTEST} to {LONGEST:g} are played")
    course = PhaseCourse.of(round(seconds * rate), 1, loop=True)
    mean = np.tensordot(shares, [part.stored.mean[0].astype(np.float64) for part in own], 1)
    paces = np.array([_pace(library.encoding, part) for part in own])
    tried: list[tuple[PhaseConceptorMotion, float, float, float]] = []
    for factor in APERTURES:
        played = _leaning(library.encoding, own[0], course, _cut(mixed, factor, mean, own[0], course))
        tried.append((played, *_liveliness(_pace(library.encoding, played), paces, shares), factor))
    smooth = [one for one in tried if one[1] <= LIVELIEST and one[2] <= 1.0]
    return max(smooth, key=lambda one: one[1]) if smooth else min(tried, key=lambda one: one[2])


class _Term(NamedTuple):
    """A conceptor (q + 1, q + 1) in the directions of M motions and one for all else; how often each is in it (M,)."""

    matrix: Array
    own: Array  # of motions that are not negated
    negated: Array  # of those that are


def _terms(motions: Mapping[str, PhaseConceptorMotion]) -> tuple[Array, dict[str, _Term]]:
    """Orthonormal directions (N, q) of motions, and each motion in them."""
    bases = [part.stored.basis[0].astype(np.float64) for part in motions.values()]
    basis, _ = np.linalg.qr(np.hstack(bases or [np.empty((1, 0))]))
    found: dict[str, _Term] = {}
    for place, (name, part) in enumerate(motions.items()):
        seen = np.vstack([basis.T @ bases[place], np.zeros(bases[place].shape[1])])
        matrix = _conceptor((seen * part.stored.strength[0]) @ seen.T)
        matrix += FLOOR * (np.eye(len(matrix)) - matrix)
        found[name] = _Term(matrix, np.eye(len(motions))[place], np.zeros(len(motions)))
    return basis, found


def _conceptor(matrix: Array) -> Array:
    """A symmetric matrix with its eigenvalues brought to 0 to 1."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.clip(values, 0.0, 1.0)) @ vectors.T


class _Reading:
    """Reads an expression, ~ before &, & before |, | before a share, and these before + and -."""

    def __init__(self, text: str, tokens: list[str], terms: Mapping[str, _Term], network: AnyNetwork) -> None:
        self._text, self._left, self._terms, self._network = text, deque(tokens), terms, network

    def whole(self) -> _Term:
        term = self._sum()
        if self._left:
            raise self._error(f"'{self._left[0]}' is not expected there")
        if not term.own.any():
            raise self._error("every motion in it is negated")
        if term.matrix[-1, -1] > 0.5:
            raise self._error("it lets through what none of its motions does; join what is negated by & to a motion")
        return term

    def _sum(self) -> _Term:
        parts = [(self._share(), self._or())]
        while sign := self._next("+", "-"):
            parts.append((self._share() if sign == "+" else -self._share(), self._or()))
        if len(parts) == 1 and parts[0][0] == 1.0:
            return parts[0][1]
        if abs((total := sum(share for share, _ in parts)) - 1.0) > 1e-6:
            raise self._error(f"its shares add up to {total:g} and have to add up to 1")
        if not all(term.own.any() for _, term in parts):
            raise self._error("what is negated has no share; join it by & to a motion")
        matrix = _conceptor(np.sum([share * term.matrix for share, term in parts], axis=0))
        own = np.sum([share * term.own / term.own.sum() for share, term in parts], axis=0)
        return _Term(matrix, own, np.zeros_like(own))

    def _share(self) -> float:
        if self._left and re.fullmatch(r"-?(\d+\.?\d*|\.\d+)", self._left[0]) and self._left[0] not in self._terms:
            return float(self._left.popleft())
        return 1.0

    def _or(self) -> _Term:
        return self._joined("|", lambda: self._joined("&", self._not, conjunction), disjunction)

    def _joined(self, sign: str, part: Callable[[], _Term], by: Callable[[Array, Array], Array]) -> _Term:
        term = part()
        while self._next(sign):
            other = part()
            term = _Term(by(term.matrix, other.matrix), term.own + other.own, term.negated + other.negated)
        return term

    def _not(self) -> _Term:
        if self._next("~"):
            term = self._not()
            return _Term(negation(term.matrix), term.negated, term.own)
        if self._next("("):
            term = self._sum()
            if not self._next(")"):
                raise self._error("a ) is missing")
            return term
        if not self._left or self._left[0] in "()&|+-":
            raise self._error("a motion is missing" + (f" before '{self._left[0]}'" if self._left else " at its end"))
        name = self._left.popleft()
        if name in self._network.motions and name not in self._terms:
            raise self._error(f"'{name}' is a one-shot, or is not read by the readout of all; it cannot be mixed")
        if name not in self._terms:
            raise UnknownNameError.among("motion", name, self._network.mixable)
        return self._terms[name]

    def _next(self, *signs: str) -> str:
        return self._left.popleft() if self._left and self._left[0] in signs else ""

    def _error(self, reason: str) -> MotiondeckError:
        return MotiondeckError(f"'{self._text}': {reason}")


def _cut(
    mixed: MixedConceptor, factor: float, mean: Array, like: PhaseConceptorMotion, course: PhaseCourse
) -> tuple[Array, Array, Array]:
    """The k directions (N, k) that a conceptor with its aperture times a factor moves most in, their strengths and m.

    Of a mixture of two motions all directions are about as strong: how strong they are does not tell them apart.
    """
    matrix = adapt_aperture(mixed.matrix, factor)
    values, vectors = np.linalg.eigh(matrix)
    motion = _motion(like, course, mixed.directions @ vectors, values, mean)
    states = motion.states @ (motion.stored.basis[0].T @ mixed.directions)
    rank = like.readout.shape[2] - 1
    moved = np.linalg.svd(states - states.mean(0), full_matrices=False)[2][:rank].T
    values, vectors = np.linalg.eigh(moved.T @ matrix @ moved)
    return mixed.directions @ (moved @ vectors), np.clip(values, 0.0, 1.0), mean


def _motion(
    like: PhaseConceptorMotion, course: PhaseCourse, directions: Array, strength: Array, mean: Array
) -> PhaseConceptorMotion:
    """A motion that shares V and W_out with another."""
    stored = StoredPieces.unread(directions, strength, mean, (len(like.shared["readout"]), len(strength)))
    return PhaseConceptorMotion(stored, course, like.reservoir, None, like.shared)


def _leaning(
    encoding: Encoding, like: PhaseConceptorMotion, course: PhaseCourse, state: tuple[Array, Array, Array]
) -> PhaseConceptorMotion:
    """The motion of directions (N, k), their strengths and m, which leans where a bone would turn over."""
    directions, strength, mean = state
    readout, estimate = (like.shared[name][:, :-1].astype(np.float64) for name in ("readout", "estimate"))
    motion, fixed = _motion(like, course, *state), np.vstack([readout, estimate, directions.T])
    wanted = np.zeros(len(fixed))
    for _ in range(0 if encoding.skeleton.is_rig else LEAN_ROUNDS):
        aside = _aside(motion.read()[:, FIRST_BONE:])
        if not aside.any():
            break
        wanted[FIRST_BONE : len(readout)] += aside
        lean = np.asarray(np.linalg.lstsq(fixed, wanted)[0], dtype=np.float64)
        motion = _motion(like, course, directions, strength, mean + lean)
    return motion


def _aside(paths: Array) -> Array:
    """What moves the directions of bones (T, 3 B) clear of zero, shape (3 B,), 0 of those that are or cannot be."""
    bones = paths.reshape(len(paths), -1, 3)
    aside = np.zeros(bones.shape[1:])
    for bone in np.flatnonzero(np.linalg.norm(bones, axis=2).min(0) < CLEAR):
        for far in LEANS:
            least = np.linalg.norm(bones[:, bone, None] + far * _WAYS, axis=2).min(0)
            if least.max() > 1.1 * CLEAR:
                aside[bone] = far * _WAYS[least.argmax()]
                break
    return aside.ravel()


def _pace(encoding: Encoding, motion: PhaseConceptorMotion) -> tuple[float, float]:
    """How far the joints of a motion go in a round, root mean square, and their largest jerk."""
    joints = joint_features(encoding, motion.read())
    joints = np.concatenate([joints, joints[:3]])
    speed = np.sqrt(np.square(np.diff(joints[:-2], axis=0)).mean()) * len(motion)
    return float(speed), float(np.abs(np.diff(joints, 3, axis=0)).max())


def _liveliness(played: tuple[float, float], paces: Array, shares: Array) -> tuple[float, float]:
    """The pace of a motion beside those (M, 2) of its motions in step: how fast it is, and its largest jerk."""
    weight, (speeds, jerks) = np.abs(shares), paces.T
    return float(played[0] * weight.sum() / (weight @ speeds)), float(played[1] / jerks[weight > 0.0].max())
