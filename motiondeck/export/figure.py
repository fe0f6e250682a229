"""A figure: a library of joint motions as the words that `player.c` reads.

What a phase-driven network plays is a function of its phase. A figure has that function as keys of splines
(`networks.keys`), as close as MOST_BYTES of a motion allow, at most one key a frame, or a centralized network itself
(`board_network`); and with it what the deck knows of the motions: where they may be entered, how fast they are, which
lie between two others. The root of a baked motion is left out; only its joints are played, and only they are compared
and limited where motions are joined.

    0 "MDP2" or "MDX2", 1 number of words, 2 CRC-32 of all other words, 3 joints, 4 motions, 5 ticks a second,
    6 frames a tick, 7 limits, 8 motions, 9 ways, 10 names (offsets in words), 11 the inverse of word 1, 12 s a tick

Words have 32 bits, lowest byte first. Rows of limits and motions are `EnvelopeLimits` of `envelope.c`, per tick, and
`md_motion` of `player.h`, floats or (MDX2) in units of 2^-25, the tick of 2^-30 s; keys are 16 bits, (K, J), J even;
ways M x M bytes, the next motion from the row's to the column's; names end in 0, joints first.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from controller.deck.interfaces import JointLimits
from controller.deck.joins.deck_motions import read_motions
from controller.deck.routes import Routes
from controller.learning.trainers.clip import fitted_keys, held_frames
from controller.library.motion_library import MotionInfo, MotionLibrary
from controller.loop.safety.braking import longest_run
from controller.loop.safety.safety_envelope import check_limits
from controller.motion.encodings.joint_angles import JointAngles, JointBody
from controller.motion.encodings.robot_joints import ROOT, RobotBody
from controller.motion.rotations import Array
from controller.networks.base import AnyNetwork, Channels
from controller.networks.centralized.centralized import CentralizedMotion
from controller.networks.clip.network import ClipPlayer
from controller.networks.keys import FEWEST_KEYS, MOST_BITS, STEPS_PER_BIT, Keys
from motiondeck.export.board_network import MOST_CENTERS, BoardNetwork
from motiondeck.export.spread_deck import SEARCHED
from motiondeck_base.errors import MotiondeckError, UnknownNameError

MOST_BYTES = 8192  # of the keys of a motion
FARTHEST = 0.005  # rad, of a joint in a figure from where its network has it
MOST_JOINTS, MOST_MOTIONS, MOST_RATE = 64, 256, 200.0
_HEADER = 13  # words
_MOTION = 19  # words of md_motion
UNIT = 2.0**-25  # of a fixed-point number
_WIDEST, _LONGEST, _TIGHTEST = 12.0, 60.0, 64 * UNIT  # what fixed point holds: rad, s, and rad of a tick


@dataclass(frozen=True)
class Figure:
    """A library as a figure, and how near it is."""

    library: MotionLibrary  # that it plays, on the joints alone
    words: bytes
    limits: JointLimits
    rest: Array  # rad, shape (J,)
    rate: float  # ticks a second
    bytes_of: Mapping[str, int]  # of each motion
    held: Mapping[str, str]  # keys or network
    error: Mapping[str, tuple[float, float]]  # of each motion, root mean square and largest, rad
    fixed: bool = False  # whether its numbers are fixed-point ones


def figure_of(
    library: MotionLibrary,
    joints: Sequence[str],
    limits: JointLimits,
    rest: Array,
    rate: float,
    motions: Sequence[str] = (),
    *,
    networks: bool = False,
    fixed: bool = False,
) -> Figure:
    """The figure of some motions of a library, or all, for the joints of a robot and ticks at a rate in Hz.

    With `networks` it has those of a centralized library that are as near and as small as keys have to be, else keys of
    what they play. Joints without motion stay at `rest` (J,), rad. A baked root is played if the joints end in those of
    ROOT. MotiondeckError where the library cannot be exported, and why.
    """
    every, names = [one.name for one in library.info.motions], [*dict.fromkeys(motions)] or library.network.motions
    chosen = [library.info.motions[place] for place in UnknownNameError.indices("motion", names, every)]
    if library.network.as_phase_network is None and not library.network.by_module:
        raise MotiondeckError(f"a {library.info.network} network may lose its place in a motion: it is not exported")
    if driven := [one.name for one in chosen if one.input is not None]:
        raise MotiondeckError(f"{driven[0]} has an input besides its phase; leave it out with --motions")
    if not 1.0 <= rate <= MOST_RATE or len(joints) > MOST_JOINTS or len(names) > MOST_MOTIONS:
        asked = f"{len(joints)} joints and {len(names)} motions at {rate:g} Hz"
        raise MotiondeckError(f"{asked}; at most {MOST_JOINTS}, {MOST_MOTIONS} and {MOST_RATE:g} Hz are played")
    if networks and fixed:
        raise MotiondeckError("networks are evaluated in floating point: leave out --networks or --fixed")
    check_limits(limits)
    stored: Any = library.encoding  # of joints, as every rig's
    rooted, bones = tuple(joints[-len(ROOT) :]) == ROOT, library.skeleton.bones
    if isinstance(library.skeleton, RobotBody) and not rooted:
        bones = library.skeleton.robot_joints
    if missing := [bone for bone in bones if bone not in joints]:
        raise MotiondeckError(f"the library moves {missing[0]}, which is no joint there; it has {', '.join(joints)}")
    order = [joints.index(bone) for bone in bones]
    most = MOST_BYTES // (4 * -(-(len(joints) - rooted * len(ROOT)) // 2))  # keys of a motion
    keys, error = dict[str, Any](), dict[str, tuple[float, float]]()
    for one in chosen:
        frames = np.tile(rest, (one.frames, 1))
        frames[:, order] = (stored.scale * _played(library.network.twin(), one))[:, : len(order)]
        loop, part = one.plays == "loop", library.network[one.name]
        keys[one.name], off = None, np.array(np.inf)
        if networks and isinstance(part, CentralizedMotion) and len(part.frequency) <= MOST_CENTERS:
            keys[one.name] = BoardNetwork.of(part, library.info.rate, order, stored.scale, rest)
            off = keys[one.name].drawn(one.frames, loop=loop) - frames
        if np.abs(off).max() > FARTHEST or len(keys[one.name].words) > MOST_BYTES:
            keys[one.name], off = _keys(one.name, frames, most, loop=loop)
        error[one.name] = float(np.sqrt(np.square(off).mean())), float(np.abs(off).max())
    loops = {one.name: one.plays == "loop" for one in chosen}
    network = ClipPlayer.of_keys(keys, {one.name: one.frames for one in chosen}, loops)
    network.every = -(-chosen[0].frames // len(library.network.anchors(chosen[0].name)))
    encoding = JointAngles(JointBody.of(joints))
    changed = {"network": "clip", "encoding": encoding.name, "skeleton": encoding.skeleton_info()}
    carried = MotionLibrary(msgspec.structs.replace(library.info, motions=chosen, **changed), network, encoding)
    sizes = {name: len(_stored(one)) for name, one in keys.items()}
    held = {name: "keys" if isinstance(one, Keys) else "network" for name, one in keys.items()}
    return Figure(carried, words_of(carried, limits, rate, fixed=fixed), limits, rest, rate, sizes, held, error, fixed)


def _played(network: AnyNetwork, motion: MotionInfo) -> Channels:
    """The frames of a motion as its network plays them once."""
    if (settled := network.settled(motion.name)) is not None:
        return settled
    frames = np.tile(network.anchors(motion.name)[0], (motion.frames, 1))
    network.cue(motion.name, 0)
    for frame in frames[1:]:
        network.advance(frame)
    return frames


def _keys(name: str, frames: Array, most: int, *, loop: bool) -> tuple[Keys, Array]:
    """At most `most` keys of a motion's frames (T, J), and by how much they miss these, rad."""
    held = held_frames(frames, loop=loop)
    every = max(1.0, (len(frames) - held) / (most - 2))
    keys = Keys.of(fitted_keys(frames, every, loop=loop), held, MOST_BITS * STEPS_PER_BIT)
    off = keys.drawn(len(frames), loop=loop) - frames
    if np.abs(off).max() > FARTHEST or most < FEWEST_KEYS + 2:
        raise MotiondeckError(
            f"{name} is too long: in {MOST_BYTES} bytes its joints are off by {1e3 * np.abs(off).max():.1f} mrad, and "
            f"{1e3 * FARTHEST:g} are allowed. Leave it out with --motions, or learn it in parts."
        )
    return keys, off


def words_of(library: MotionLibrary, limits: JointLimits, rate: float, *, fixed: bool = False) -> bytes:
    """The words of a library of keys, for ticks at a rate in Hz, in floats or fixed-point numbers."""
    network: Any = library.network  # of keys
    motions = read_motions(library)
    names, joints, routes = list(motions), library.encoding.skeleton.bones, Routes.of(library)
    ways = [names.index((*routes.way(one, other), other)[0]) for one in names for other in names]
    texts = [name.encode() + b"\0" for name in (*joints, *names)]
    parts = [limit_rows(limits, 1.0 / rate, fixed=fixed), bytes(4 * _MOTION * len(names)), bytes(ways), b"".join(texts)]
    parts += [_stored(network.keys[name]) for name in names]
    parts = [part + bytes(-len(part) % 4) for part in parts]
    starts = np.cumsum([_HEADER, *(len(part) // 4 for part in parts)])[:-1]
    rows = list[bytes]()
    for at, (number, (name, one)) in zip(starts[4:], enumerate(motions.items(), len(joints)), strict=True):
        keys, frames = network.keys[name], len(network[name])
        count, held, unit = (len(keys.counted), keys.course[1], keys.unit) if isinstance(keys, Keys) else (0, 0, 0.0)
        whole = at, count, frames, frames - int(held), one.loop, frames - (not one.loop), network.every
        whole += len(one.course), len(one.places), getattr(keys, "searched", SEARCHED)
        if fixed and max(one.seconds, one.whole) > _LONGEST:
            raise MotiondeckError(f"{name} lasts {one.seconds:.0f} s; fixed-point numbers hold {_LONGEST:g}")
        watched = np.ptp(one.places, axis=0).max(), np.abs(one.velocities).max()  # as of `BlendCheck`
        real = unit / 6.0 * (2.0**15 if fixed else 1.0), one.spacing, one.seconds, one.whole
        numbers = _numbers([*real, one.speed, one.acceleration / 64.0, *watched], fixed)
        rows.append(np.array(whole, "<u4").tobytes() + numbers + len(b"".join(texts[:number])).to_bytes(4, "little"))
    parts[1] = b"".join(rows)
    head = np.array([len(joints), len(names)], "<u4").tobytes() + np.float32(rate).tobytes()
    head += _numbers([library.info.rate / rate], fixed)
    count = (_HEADER * 4 + sum(map(len, parts))) // 4
    last = (~count & 0xFFFFFFFF).to_bytes(4, "little") + _numbers([(32 if fixed else 1) / rate], fixed)
    body = head + starts[:4].astype("<u4").tobytes() + last + b"".join(parts)
    before = (b"MDX2" if fixed else b"MDP2") + count.to_bytes(4, "little")
    return before + zlib.crc32(before + body).to_bytes(4, "little") + body


def _numbers(values: ArrayLike, fixed: bool) -> bytes:
    if not fixed:
        return np.asarray(values, "<f4").tobytes()
    return np.rint(np.minimum(np.asarray(values) / UNIT, 2.0**31 - 1)).astype("<i4").tobytes()


def limit_rows(limits: JointLimits, dt: float, *, fixed: bool) -> bytes:
    """Rows of `EnvelopeLimits`, less what 32-bit positions are rounded by, so that these keep the limits too."""
    far = np.maximum(np.abs(limits.lower), np.abs(limits.upper))
    rounding = np.full(len(far), 4 * UNIT) if fixed else np.spacing(far.astype(np.float32)).astype(float)
    v, a = limits.velocity * dt - rounding, limits.acceleration * dt**2 - 2 * rounding
    j, inset = limits.jerk * dt**3 - 4 * rounding, 2e-6 + 2.0 * rounding
    if fixed:  # a jerk that 6 divides; an acceleration that takes more than 2 sqrt(j) is never reached
        v, j, inset = np.minimum(v, 1.0), 6 * UNIT * np.floor(np.minimum(j, 2.0) / (6 * UNIT)), np.full(len(far), 4e-5)
        a = np.minimum(a, 2.0 * np.sqrt(np.maximum(j, 0.0)))
    for joint in np.flatnonzero(np.minimum(np.minimum(v, a), j) <= fixed * _TIGHTEST):
        raise MotiondeckError(f"the limits of joint {joint} are too tight for 32-bit numbers at {1.0 / dt:g} Hz")
    for joint in np.flatnonzero(far * fixed > _WIDEST):
        raise MotiondeckError(f"joint {joint} turns by {far[joint]:.1f} rad; fixed-point numbers hold {_WIDEST:g}")
    inset = np.minimum(inset, 0.5 * (limits.upper - limits.lower))
    way = [longest_run(*row) for row in zip(v, a, a, j, strict=True)]
    return _numbers(np.column_stack([v, a, j, limits.lower + inset, limits.upper - inset, way]), fixed)


def _stored(motion: Keys | BoardNetwork) -> bytes:
    """The keys or the network of a motion as the player reads them."""
    if isinstance(motion, BoardNetwork):
        return motion.words
    return np.pad(motion.counted, ((0, 0), (0, motion.counted.shape[1] % 2))).astype("<i2").tobytes()
