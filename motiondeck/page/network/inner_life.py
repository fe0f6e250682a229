"""Orbits of a network's neurons, and phases of the centers that drive it, for the page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.library.motion_library import load_library
from controller.motion.rotations import Array
from controller.networks.orbits import Orbits, orbits

TURN = 2.0 * np.pi


@dataclass(frozen=True)
class InnerLife:
    """Orbits and phase courses of a network.

    Attributes:
        orbits: of its neurons; None if it has none.
        courses: of each motion with centers, their phases at its beginning and its end, shape (2, n), rad.
    """

    orbits: Orbits | None
    courses: dict[str, Array]

    @classmethod
    def of(cls, library: Path) -> InnerLife:
        """Plays each motion of a library's file once to find it.

        Raises:
            MotiondeckError: if the file is no library any more.
        """
        loaded = load_library(library)
        network = loaded.network
        frames = {motion.name: motion.frames for motion in loaded.info.motions}
        found = orbits(network, frames) if network.activation is not None else None
        courses = {name: course for name in frames if (course := network.center_phases(name)) is not None}
        return cls(found, courses)

    def centers(self, motion: str, phase: float | None) -> list[float]:
        """The phases of the centers at the phase of a motion, in revolutions from 0 to 1; empty if it has none."""
        course = self.courses.get(motion)
        if course is None or phase is None:
            return []
        first, last = course
        return [float(turns) for turns in np.round((first + phase * (last - first)) / TURN % 1.0, 3)]
