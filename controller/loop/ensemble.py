"""An ensemble: robots that play the same poses, as one robot with the joints of all, which goes as the slowest does."""

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from controller.deck.interfaces import JointLimits, Retargeter
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose


def all_limits(limits: Sequence[JointLimits]) -> JointLimits:
    """The limits of all joints, robot after robot."""
    return JointLimits(*(np.concatenate([getattr(one, field.name) for one in limits]) for field in fields(JointLimits)))


def together(retargeters: Sequence[Retargeter]) -> Retargeter:
    """Carries a pose to the joints of all robots, one after the other; for a single one its own retargeter."""

    def all_targets(pose: Pose) -> Array:
        return np.concatenate([retarget(pose) for retarget in retargeters])

    return retargeters[0] if len(retargeters) == 1 else all_targets
