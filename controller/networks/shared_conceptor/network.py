"""A conceptor network in which the conceptor alone selects: prediction and readout are shared by all motions.

The equations and the player are those of `phase_conceptor`, but one V and one R serve every motion, as in Deliallisi
2017, eqs 3.11 and 3.13. What is left to a motion are its conceptor C and its mean state m. One R reads about as many
motions as the neurons have room for; beyond, each has its own, and so has a motion that is added later. V is
always that of all.
"""

from controller.networks.phase_conceptor.network import PhaseConceptorNetwork


class SharedConceptorNetwork(PhaseConceptorNetwork):
    """Plays motions that their conceptors select; fits `base.PhaseNetwork`."""

    kind = "shared-conceptor"


KIND = SharedConceptorNetwork
