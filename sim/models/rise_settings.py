"""Rise settings: how a robot gets up from the floor; the table [rise] of a robot file."""

from __future__ import annotations

import msgspec

Row = tuple[float, float, float, float, float, float]
"""How long it takes to get there, s, and how far a human in that pose bends hips, knees, ankles, shoulders and elbows,
rad; as `symmetric_pose.Bends`."""


class RiseSettings(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The poses by which a robot gets up, one after another.

    Attributes:
        front: from its belly, until it crouches on its feet; then it stands up to its rest pose. None if it cannot.
        back: from its back, until it lies on its belly.
    """

    front: tuple[Row, ...] = ()
    back: tuple[Row, ...] = ()
