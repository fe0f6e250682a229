"""A clip: one recorded motion of a skeleton at a constant rate."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from controller.motion.decision import Decision
from controller.motion.rotations import Array
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import FileFormatError

Plays = Literal["loop", "once"]
"""Whether a motion repeats, or ends in a pose and holds it."""


@dataclass(frozen=True, eq=False)
class Clip:
    """T frames of a skeleton with B bones.

    FileFormatError if shapes disagree, a number is not finite, the rate is not positive, or there are no frames.
    """

    name: str
    skeleton: Skeleton
    rate: float  # frames per second, Hz
    root_position: Array  # shape (T, 3), m; z up
    rotation: Array  # the world rotation of the root and of each bone, shape (T, 1 + B, 4)
    source: str = ""  # file name, for provenance
    decisions: tuple[Decision, ...] = ()  # what was decided while it was read
    plays: Plays | None = None  # how it plays, where its file says so

    def __post_init__(self) -> None:
        frames = len(self.root_position)
        expected = ((frames, 3), (frames, 1 + len(self.skeleton), 4))
        if frames == 0 or (self.root_position.shape, self.rotation.shape) != expected:
            raise FileFormatError(
                f"clip '{self.name}': arrays of shape {self.root_position.shape} and {self.rotation.shape} "
                f"do not hold frames of {len(self.skeleton)} bones"
            )
        if not (np.isfinite(self.rate) and self.rate > 0.0):
            raise FileFormatError(f"clip '{self.name}': a rate of {self.rate} frames per second is not possible")
        if not (np.isfinite(self.root_position).all() and np.isfinite(self.rotation).all()):
            raise FileFormatError(f"clip '{self.name}' holds a number that is not finite")

    def __len__(self) -> int:
        return len(self.root_position)

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the end of the last."""
        return len(self) / self.rate

    def joints(self) -> Array:
        """Joint positions, the root first, shape (T, 1 + B, 3), m."""
        return self.skeleton.joints(self.root_position, self.rotation)
