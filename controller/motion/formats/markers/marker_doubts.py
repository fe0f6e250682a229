"""What looks wrong about markers on a body: those that are for a time where their place on it cannot be."""

from __future__ import annotations

import numpy as np

from controller.motion.formats.markers.marker_fit import Fit

MISPLACED = 0.15  # m off its place: skin and fit leave 0.13 at most in the recordings we have, a cartwheel included


def misplaced(fit: Fit) -> list[str]:
    """One line about the marker that is most often far from its place, and how many others are; none if none is."""
    far = np.nan_to_num(fit.residual) > MISPLACED
    if not far.any():
        return []
    worst = int(np.argmax(far.sum(axis=0)))
    others = int(far.any(axis=0).sum()) - 1
    more = f", as {others} other{'s are' if others > 1 else ' is'}" if others else ""
    distance, share = np.nanmax(fit.residual[:, worst]), 100.0 * far[:, worst].mean()
    begins = int(np.argmax(far[:, worst])) / fit.clip.rate
    return [
        f"marker '{fit.markers[worst]}' is up to {distance:.2f} m off its place on the body, in {share:.1f} % of the "
        f"frames, first at {begins:.2f} s{more}: labels may be exchanged. Mend them, or cut that "
        "part out (clip convert --from --to)."
    ]
