"""A conceptor network in which the conceptor alone selects: prediction and readout are shared by all motions.

The equations are those of `phase_conceptor`, but one V and one W_out serve every motion, as in Deliallisi 2017, eqs
3.11 and 3.13. What is left to a motion, or to a piece of a long one, are its conceptor C ~ U S U' and its mean state m:

    x(n+1)  = m + C (tanh(W x(n) + W_in (V x(n) + v) + W_phi p(phi(n+1)) + b) - m)
    y(n)    = W_out x(n) + w

It plays in the k directions U of a conceptor as those do: V U, V m + v, W_out U and W_out m + w are computed when it is
loaded. One W_out reads about as many motions as the neurons have room for. Beyond, each reads in its own directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.networks.driving_input import DrivingInput
from controller.networks.phase_conceptor.network import (
    Float16,
    PhaseConceptorMotion,
    PhaseConceptorNetwork,
    StoredPieces,
)
from controller.networks.reservoirs.phase_driven import stored_course
from controller.networks.reservoirs.phase_reservoir import Float32, PhaseCourse, PhaseReservoir
from controller.networks.storage import StoredNetwork


@dataclass(frozen=True)
class Selection:
    """What selects a motion of P pieces among N neurons: its conceptors of rank k."""

    directions: Float16  # U, shape (P, N, k), half precision
    strength: Float32  # the diagonal of S, shape (P, k)
    mean: Float16  # m, shape (P, N), half precision

    def reading(self, weights: Float32) -> Float32:
        """Shared weights (A, a) of C channels (C, N + 1) as each piece sees them, (A U, A m + a) (P, C, k + 1)."""
        seen = weights[:, :-1] @ np.concatenate([self.directions, self.mean[..., None]], axis=2).astype(np.float32)
        seen[..., -1] += weights[:, -1]
        return seen


class SharedConceptorMotion(PhaseConceptorMotion):
    """One motion, ready to be played.

    `estimate` is (V, v) in normalised channels, shape (C, N + 1), and `weights` the readout in the units of the
    encoding: (W_out, w), of the same shape, or what the motion reads in its own directions, shape (P, C, k + 1).
    """

    def __init__(
        self,
        selection: Selection,
        estimate: Float32,
        weights: Float32,
        course: PhaseCourse,
        reservoir: PhaseReservoir,
        driving: DrivingInput | None = None,
    ) -> None:
        self.selection, self.estimate, self.weights = selection, estimate, weights
        parts = selection.directions, selection.strength, selection.mean
        readout = selection.reading(weights) if weights.ndim == 2 else weights
        super().__init__(
            StoredPieces(*parts, selection.reading(estimate).astype(np.float16), readout), course, reservoir, driving
        )


class SharedConceptorNetwork(PhaseConceptorNetwork):
    """Plays motions that their conceptors select; fits `base.PhaseNetwork`."""

    kind = "shared-conceptor"

    def arrays(self) -> dict[str, NDArray[Any]]:
        found = super().arrays()
        motions: list[Any] = [self[name] for name in self.motions]
        found["shared/estimate"] = motions[0].estimate
        if shares := motions[0].weights.ndim == 2:
            found["shared/readout"] = motions[0].weights
        for name in self.motions:
            del found[f"motion/{name}/estimate"]
            if shares:
                del found[f"motion/{name}/readout"]
        return found

    @classmethod
    def load_motions(
        cls, stored: StoredNetwork, sizes: dict[str, int], reservoir: PhaseReservoir
    ) -> dict[str, PhaseConceptorMotion]:
        whole = sizes | {"m": sizes["n"] + 1}
        estimate = stored.read("shared/", whole, estimate="cm")["estimate"]
        shared = stored.read("shared/", whole, readout="cm") if "shared/readout" in stored.stored else None
        motions: dict[str, PhaseConceptorMotion] = {}
        for motion in stored.header.motions:
            at, own = f"motion/{motion.name}/", dict(sizes)
            half = stored.read(at, own, np.float16, directions="pnk", mean="pn")
            sizes["k"], own["e"] = own["k"], own["k"] + 1  # all motions have one rank
            selection = Selection(**half, **stored.read(at, own, strength="pk"))
            weights = (shared or stored.read(at, own, readout="pce"))["readout"]
            course = stored_course(stored, motion, own["p"])
            motions[motion.name] = SharedConceptorMotion(selection, estimate, weights, course, reservoir, motion.input)
        return motions


KIND = SharedConceptorNetwork
