"""Carries what is particular about one motion to another: its frequencies, or its style as a direction.

Frequencies are those of the centers of a centralized network (Vakulenko et al. 2017, section 4). A style is the
difference of two motions that were recorded with it and without it, such as an old walk and a walk. In a network that a
phase drives it is added to what a third motion reads out:

    y(n) = R x(n) + r + s (mean of y in the style - mean of y without it)

Only the means are carried over: how a walk and a bow change with the phase has nothing in common. Velocities are left
as they are.
"""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np

from controller.library.motion_library import MotionLibrary
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.rotations import Array
from controller.networks.base import AnyNetwork
from controller.networks.centralized.centers import require_frequencies
from controller.networks.centralized.centralized import CentralizedMotion
from controller.networks.centralized.network import CentralizedNetwork
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork
from motiondeck_base.errors import MotiondeckError

UNTAUGHT = "nobody has taught it: there is nothing to test it by"


def restyled(library: MotionLibrary, motion: str, like: str) -> tuple[MotionLibrary, float]:
    """The library with one more motion, and how far its joints leave the places they had before, mm.

    The new motion's slow center keeps the number of turns it makes in a period, so that a loop stays closed.

    Raises:
        MotiondeckError: if the network is not a centralized one, the motion is there already, or the two do not have
            equally many centers.
        UnknownNameError: if there is no such motion.
    """
    network = library.network
    if not isinstance(network, CentralizedNetwork):
        raise MotiondeckError(
            f"library '{library.info.name}' holds no centralized network, and so no frequencies; "
            "in a phase-driven one name the same action without the style: --unlike NEUTRAL"
        )
    part, other, name = network[motion], network[like], _new_name(library, motion, like)
    styled = with_frequencies(part, other.frequency)
    frames = round(styled.seconds * network.rate)
    # A library counts whole frames: the period is rounded to them, and all centers with it.
    seconds = (frames if styled.loop else max(1, frames - 1)) / network.rate
    styled = replace(styled, frequency=styled.frequency * styled.seconds / seconds, seconds=seconds)
    before, after = (
        joint_features(library.encoding, p.at(np.arange(0.0, p.seconds, 1.0 / network.rate))) for p in (part, styled)
    )
    outside = max(0.0, float((after - before.max(0)).max()), float((before.min(0) - after).max()))
    parts = {m: network[m] for m in network.motions} | {name: styled}
    return _grown(library, motion, name, frames, CentralizedNetwork(parts, network.rate)), outside


def with_frequencies(part: CentralizedMotion, frequency: Array) -> CentralizedMotion:
    """The same satellites driven by other frequencies, those of another clip: its style on this motion.

    Raises:
        MotiondeckError: if there are not as many as centers, or a loop would no longer close.
    """
    if frequency.shape != part.frequency.shape:
        raise MotiondeckError(f"{len(frequency)} frequencies for {len(part.frequency)} centers")
    require_frequencies(frequency)
    slowest = int(part.frequency.argmin())
    seconds = part.seconds * float(part.frequency[slowest] / frequency[slowest])
    return replace(part, frequency=frequency, seconds=seconds)


def in_the_style(
    library: MotionLibrary, motion: str, like: str, unlike: str, strength: float = 1.0
) -> tuple[MotionLibrary, float]:
    """The library with one more motion, and how far its joints are from where they were, mean, mm.

    Args:
        library: of phase-driven motions without inputs.
        motion: what is changed.
        like, unlike: the same action with the style and without it.
        strength: s; 1 is the whole difference, and more exaggerates it.

    Raises:
        MotiondeckError: if no phase drives the network, the new motion is there already, or the strength is not finite.
        UnknownNameError: if there is no such motion.
    """
    network = library.network
    if not isinstance(network, PhaseDrivenNetwork):
        raise MotiondeckError(f"library '{library.info.name}' holds a network without a phase: it takes no style")
    if not np.isfinite(strength):
        raise MotiondeckError(f"a style of strength {strength}: give a finite number")
    part, name = network[motion], _new_name(library, motion, like)
    direction = strength * (network.moving(like).mean(0) - network.moving(unlike).mean(0))
    direction[library.encoding.velocities] = 0.0
    readout = part.stored.readout.copy()
    readout[:, :, -1] += direction.astype(np.float32)
    styled = type(part)(replace(part.stored, readout=readout), part.course, part.reservoir, part.driving)
    grown = network.with_motions({name: styled})
    before, after = (joint_features(library.encoding, grown.settled(one)) for one in (motion, name))
    moved = np.linalg.norm((after - before)[:, :-1].reshape(len(after), -1, 3), axis=-1)
    return _grown(library, motion, name, len(styled), grown), float(moved.mean())


def _new_name(library: MotionLibrary, motion: str, like: str) -> str:
    name = f"{motion}-like-{like}"[:40]
    if name in library.network.motions:
        raise MotiondeckError(f"library '{library.info.name}' has a motion '{name}' already")
    return name


def _grown(library: MotionLibrary, motion: str, name: str, frames: int, network: AnyNetwork) -> MotionLibrary:
    """The library with a network that plays one more motion, made from another."""
    known = next(info for info in library.info.motions if info.name == motion)
    info = msgspec.structs.replace(known, name=name, frames=frames, passed=False, reason=UNTAUGHT)
    header = msgspec.structs.replace(library.info, motions=[*library.info.motions, info])
    return MotionLibrary(header, network, library.encoding)
