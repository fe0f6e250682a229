"""Trains a movement primitive: common satellites for all demonstrations of a motion, and weights for each."""

from collections.abc import Sequence

import numpy as np

from controller.learning.centralized.satellite_learning import learn, ridge_readout, slow_and_fast
from controller.motion.rotations import Array
from controller.networks.centralized.movement_primitive import MovementPrimitive
from controller.networks.entry_points import channel_scale
from controller.networks.signals import sampling_rate, time_series
from motiondeck_base.errors import MotiondeckError

# Deviation of a channel from the demonstrations, relative to its standard deviation.
BEND = 0.3


def learn_primitive(
    demonstrations: Sequence[Array], rate: float, *, satellites: int = 30, iterations: int = 100
) -> MovementPrimitive:
    """The primitive of demonstrations (K_i, D) of one motion at a rate, Hz, from the same first to the same last frame.

    It has `satellites`, at most a third of the frames of the shortest demonstration, and takes `iterations` of L-BFGS.
    MotiondeckError if there is none, one is too short, their channels differ or a number is not finite.
    """
    if len(demonstrations) == 0:
        raise MotiondeckError("a movement primitive needs one demonstration at least, two for a spread")
    rate = sampling_rate(rate)
    channels = time_series(demonstrations[0], "demonstration 0").shape[1]
    demonstrations = [time_series(one, f"demonstration {i}", channels) for i, one in enumerate(demonstrations)]
    for index, each in enumerate(demonstrations):
        if len(each) < 6:
            raise MotiondeckError(f"demonstration {index} is of shape {each.shape}; 6 frames are needed at least")
    frames = round(float(np.median([len(each) for each in demonstrations])))
    phase = np.linspace(0.0, 1.0, frames)
    aligned = np.stack([_at(each, phase) for each in demonstrations])
    rest, scale = aligned.mean((0, 1)), channel_scale(aligned.std((0, 1)))
    scaled = (aligned - rest) / scale
    side_by_side = scaled.transpose(1, 0, 2).reshape(frames, -1)
    count = max(1, min(satellites, min(len(each) for each in demonstrations) // 3))
    learned = learn(side_by_side, phase, count, slow_and_fast(1.0, 1, 1, 0), iterations=iterations)
    weights = ridge_readout(learned.respond(phase), side_by_side).reshape(len(aligned), channels, count)
    seconds = np.array([(len(each) - 1) / rate for each in demonstrations])
    weights = weights * scale[:, None]
    return MovementPrimitive(learned.frequency, learned.phase, learned.satellites, weights, rest, BEND * scale, seconds)


def _at(demonstration: Array, phase: Array) -> Array:
    own = np.linspace(0.0, 1.0, len(demonstration))
    return np.stack([np.interp(phase, own, column) for column in demonstration.T], axis=-1)
