"""An ensemble: robots that play the same poses, as one robot with the joints of all, which goes as the slowest does."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import fields

import numpy as np

from controller.deck.interfaces import JointLimits, Output, Retargeter
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


class RobotOutput:
    """The output of one robot of an ensemble, for its joints, the first of all given; fits `interfaces.Output`."""

    def __init__(self, output: Output, first: int, joints: int, of: int, called: str = "") -> None:
        self.name = called + output.name
        self._output = output
        self._mine = slice(first, first + joints)
        self._measured, self._held = np.full(of, np.nan), np.full(of, np.nan)
        # Of this robot's joints, 0 for all others, shape (of,), s; None if the output has none.
        self.lag: Array | None = None
        if (own := getattr(output, "lag", None)) is not None:
            self.lag = np.zeros(of)
            self.lag[self._mine] = own

    def write(self, targets: Array, pose: Pose) -> None:
        """Writes this robot's targets."""
        self._output.write(targets[self._mine], pose)

    def measured(self) -> Array | None:
        """The measured positions of this robot's joints, NaN for all others."""
        measured = self._output.measured()
        if measured is None:
            return None
        self._measured[self._mine] = measured
        return self._measured

    def held(self) -> Array | None:
        """Where the output holds this robot's joints on its own, NaN for all others; None while it follows."""
        held = getattr(self._output, "held", None)
        if held is None or (own := held()) is None:
            return None
        self._held[self._mine] = own
        return self._held

    @property
    def at_rest(self) -> bool:
        """Whether the output, if it brakes joints on its own, holds them."""
        return getattr(self._output, "at_rest", True)

    @property
    def incidents(self) -> Sequence[str]:
        """What has happened to the output's servos lately, in words, if it has any."""
        return getattr(self._output, "incidents", ())

    @property
    def explain(self) -> Callable[[Collection[str]], list[tuple[str, bool]]] | None:
        """Says of some of them the causes, and whether each is a fault, if the output can."""
        return getattr(self._output, "explain", None)

    def report(self) -> Mapping[str, object]:
        """The output's own report."""
        return self._output.report()

    def close(self) -> None:
        """Closes the output."""
        self._output.close()
