"""Learns the readouts of a motion that a phase drives from the states in which it settles."""

import numpy as np

from controller.motion.rotations import Array, Indices
from controller.networks.reservoirs.phase_driven import PhaseMotion
from controller.networks.reservoirs.phase_reservoir import Float32
from controller.networks.ridge import affine_ridge

# Frames on either side of a seam and their weight for a readout, so that both pieces meet there.
SEAM_FRAMES, SEAM_WEIGHT = 3, 100.0

# Steps after the end of a one-shot, of which every HELD_EVERY-th counts for the readout of the pose that it holds.
HELD_STEPS, HELD_EVERY = 600, 10


def settled_frames(unread: PhaseMotion, frames: Array) -> tuple[Float32, Array, Indices]:
    """The states in which a motion settles at its frames (T, C) and after the end of a one-shot; frames and pieces."""
    states, piece = unread.states, unread.course.piece
    if unread.course.loop:
        return states, frames, piece
    # The end may settle slowly, or in another state than the one in which it was learned.
    later = unread.held_on(HELD_STEPS)[HELD_EVERY - 1 :: HELD_EVERY]
    held = np.repeat(frames[-1:], len(later), axis=0)
    pieces = np.concatenate([piece, np.repeat(piece[-1:], len(later))])
    return np.concatenate([states, later]), np.concatenate([frames, held]), pieces


def learn_readouts(states: Float32, piece: Indices, frames: Array, regulariser: float) -> Float32:
    """A readout (R, r) of each piece, (P, C, k + 1), of settled states (T, k), frames (T, C) and their `piece` (T,)."""
    pieces = [np.flatnonzero(piece == one) for one in range(int(piece.max()) + 1)]
    weight = np.ones(len(frames))
    for own in pieces if len(pieces) > 1 else []:
        weight[own[:SEAM_FRAMES]] = weight[own[-SEAM_FRAMES:]] = SEAM_WEIGHT
    found = [affine_ridge(states[own].astype(np.float64), frames[own], regulariser, weight[own]) for own in pieces]
    # In the memory layout of a loaded network, which then plays bit by bit the same.
    return np.ascontiguousarray(np.stack(found), dtype=np.float32)
