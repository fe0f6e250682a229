"""Teaching a phase-driven echo-state network: ridge readouts from the states that the phase alone leads to.

The channels are not fed back, so what the network will do when it plays is known before anything is learned, and one
regression a piece is all of the training. Nothing of one motion depends on another.
"""

from __future__ import annotations

import msgspec

from controller.mocap.encodings.normalisation import Normalisation
from controller.networks.reservoirs.phase_echo_state import PhaseEchoStateMotion, PhaseEchoStateNetwork, driven_states
from controller.networks.reservoirs.phase_reservoir import ANCHOR_EVERY, PhaseReservoir, PhaseScales
from controller.training.preparation.training_motion import TrainingMotion
from controller.training.reservoirs.phase_training import course_of, learn_readouts


class PhaseEchoStateRecipe(
    msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="phase-echo-state"
):
    """The parameters of a phase-driven echo-state network.

    Attributes:
        neurons: N.
        harmonics: H of the phase.
        spectral_radius: of W.
        phase_scale, bias_scale: of W_phi and b.
        piece_seconds: about how long the pieces are that a motion is cut into, s.
        ridge: gamma.
    """

    neurons: int = 100
    harmonics: int = 4
    spectral_radius: float = 0.9
    phase_scale: float = 3.0
    bias_scale: float = 0.8
    piece_seconds: float = 1.5
    ridge: float = 1e-3

    @property
    def anchor_every(self) -> int:
        """Frames between the states that a motion can be entered at."""
        return ANCHOR_EVERY

    @property
    def scales(self) -> PhaseScales:
        """What the shared weights are drawn with; the channels are no input."""
        return PhaseScales(self.neurons, self.harmonics, self.spectral_radius, 0.0, self.phase_scale, self.bias_scale)


def train_phase_echo_state(
    to_learn: list[TrainingMotion], normalisation: Normalisation, recipe: PhaseEchoStateRecipe, rate: float, seed: int
) -> PhaseEchoStateNetwork:
    """One network that holds all motions.

    Args:
        to_learn: the motions.
        normalisation: between their channels and the encoding's units.
        recipe: sizes and scales.
        rate: frames per second.
        seed: of everything random.
    """
    reservoir = PhaseReservoir.draw(recipe.scales, to_learn[0].frames.shape[1], seed)
    motions = {one.name: learn_echo(one, reservoir, normalisation, recipe, rate) for one in to_learn}
    return PhaseEchoStateNetwork(recipe.scales, seed, normalisation, motions)


def learn_echo(
    motion: TrainingMotion,
    reservoir: PhaseReservoir,
    normalisation: Normalisation,
    recipe: PhaseEchoStateRecipe,
    rate: float,
) -> PhaseEchoStateMotion:
    """One motion in a reservoir."""
    course = course_of(motion, recipe.piece_seconds * rate)
    _, states = driven_states(course, reservoir)
    readout = learn_readouts(states, course, normalisation.invert(motion.frames), recipe.ridge)
    return PhaseEchoStateMotion(readout, course, reservoir)
