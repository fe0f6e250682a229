"""A body of average proportions, for what has to be said of a robot without any recording at hand."""

from __future__ import annotations

import numpy as np

from controller.motion.skeleton import Skeleton
from controller.motion.thesis_body import thesis_skeleton

STATURE = 1.75
# Lengths of the 19 bones over the stature (Drillis and Contini 1966, as in Winter 2009, fig. 4.1): hip, thigh, shank
# and foot of either side; back, neck and head; shoulder, upper arm, forearm and hand of either side.
_LEG = (0.0955, 0.245, 0.246, 0.11)
_TRUNK = (0.144, 0.144, 0.13)
_ARM = (0.1295, 0.186, 0.146, 0.108)


def reference_body() -> Skeleton:
    """The skeleton, with the bones of Jaeger's patterns."""
    return thesis_skeleton(STATURE * np.array([*_LEG, *_LEG, *_TRUNK, *_ARM, *_ARM]), "average body")
