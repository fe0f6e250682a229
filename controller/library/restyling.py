"""Carries the frequencies of one motion to another (Vakulenko et al. 2017, section 4)."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np

from controller.library.motion_library import MotionLibrary
from controller.measures.motion_matching import joint_features
from controller.networks.centralized.centralized_frames import CentralizedNetwork
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
        raise MotiondeckError(f"library '{library.info.name}' holds no centralized network, and so no frequencies")
    part, other = network[motion], network[like]
    name = f"{motion}-like-{like}"[:40]
    if name in network.motions:
        raise MotiondeckError(f"library '{library.info.name}' has a motion '{name}' already")
    styled = part.with_frequencies(other.frequency)
    frames = round(styled.seconds * network.rate)
    # A library counts whole frames: the period is rounded to them, and all centers with it.
    seconds = (frames if styled.loop else max(1, frames - 1)) / network.rate
    styled = replace(styled, frequency=styled.frequency * styled.seconds / seconds, seconds=seconds)
    before, after = (
        joint_features(library.encoding, p.at(np.arange(0.0, p.seconds, 1.0 / network.rate))) for p in (part, styled)
    )
    outside = max(0.0, float((after - before.max(0)).max()), float((before.min(0) - after).max()))
    known = next(info for info in library.info.motions if info.name == motion)
    info = msgspec.structs.replace(known, name=name, frames=frames, passed=False, reason=UNTAUGHT)
    parts = {m: network[m] for m in network.motions} | {name: styled}
    header = msgspec.structs.replace(library.info, motions=[*library.info.motions, info])
    return MotionLibrary(header, CentralizedNetwork(parts, network.rate), library.encoding), outside
