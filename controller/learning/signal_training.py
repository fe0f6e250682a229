"""Trains networks on any time series (T, D).

Motions need a body and an encoding; the networks themselves do not. A signal is normalised to [-1, 1]; its first frames
are the washout.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from controller.learning.measures import self_test
from controller.learning.preparation.training_motion import Lessons, TrainingMotion
from controller.learning.recipe import NetworkRecipe, require_sizes
from controller.learning.reservoirs.conceptor_training import ConceptorRecipe, load_reservoir
from controller.learning.trainers.trainer import trainer_of
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array
from controller.networks.base import AnyNetwork, FrameNetwork
from controller.networks.reservoirs.loaded_signals import LoadedSignals
from controller.networks.reservoirs.reservoir import Reservoir, drive
from controller.networks.ridge import ridge
from controller.networks.signals import number_within, time_series, whole_number
from motiondeck_base.errors import MotiondeckError

# After Jaeger 2014, section 3.2, for normalised signals.
SMALL_RESERVOIR = ConceptorRecipe(
    neurons=100, spectral_radius=1.5, input_scale=1.5, bias_scale=0.2, learns="weights", ridge=1e-3, washout=100
)


def load_signals(
    signals: Mapping[str, Array], recipe: ConceptorRecipe = SMALL_RESERVOIR, seed: int = 0
) -> LoadedSignals:
    """Loads signals (T, D) into one reservoir (Jaeger 2014, section 3.3), for computing with their conceptors.

    The first `recipe.washout` frames are not learned; the recipe's aperture, form and rank are ignored. MotiondeckError
    if there is no signal, channels differ, a signal is too short, or a number is not finite.
    """
    require_sizes(recipe)
    motions, normalisation = _motions(signals, (), recipe.washout)
    loaded = load_reservoir(motions, recipe, seed)
    states = {motion.name: own for motion, own in zip(motions, loaded.states, strict=True)}
    return LoadedSignals(loaded.reservoir, loaded.weights, loaded.readout, normalisation, states)


def learn_signals(
    signals: Mapping[str, Array],
    recipe: NetworkRecipe = SMALL_RESERVOIR,
    *,
    rate: float = 1.0,
    loops: Collection[str] = (),
    seed: int = 0,
) -> AnyNetwork:
    """One network that plays all signals (T, D), of the kind that the recipe names, by default conceptors.

    In `loops` are the signals that are one period, whose first frame follows the last. What is learned in frames does
    not depend on the rate, Hz. MotiondeckError as `load_signals`, or if a name in `loops` is no signal, or the rate is
    not from 0.001 Hz to 100 kHz.
    """
    require_sizes(recipe)
    hertz, drawn_with = number_within(rate, "the rate, Hz,", 1e-3, 1e5), whole_number(seed, "seed")
    motions, normalisation = _motions(signals, [loops] if isinstance(loops, str) else loops, 0)
    return trainer_of(recipe).train(recipe, Lessons(motions, normalisation, hertz), drawn_with)


def run_free(network: FrameNetwork, motion: str, frames: int, anchor: int = 0) -> Array:
    """The output of a network of `learn_signals` without input from a stored state, shape (frames, C).

    Anchor 0 is the state at the start of the signal. UnknownNameError if there is no such motion; it names the nearest.
    MotiondeckError if frames is no whole number, or there is no such anchor.
    """
    count, start, anchors = whole_number(frames, "frames"), whole_number(anchor, "anchor"), len(network.anchors(motion))
    if start >= anchors:
        raise MotiondeckError(f"anchor is {start}; '{motion}' has anchors from 0 to {anchors - 1}")
    return self_test.run_free(network, motion, count, start)


@dataclass(frozen=True, eq=False)
class ReservoirResponse:
    """A driven reservoir with a readout W_out (D, N): an input signal (T, C) in, an output signal (T, D) out."""

    reservoir: Reservoir
    readout: Array

    def respond(self, inputs: Array) -> Array:
        """The outputs to inputs (T, C), shape (T, D), from x = 0; the first frames are a transient.

        MotiondeckError if the inputs are not of that shape, or a number is not finite.
        """
        (states,) = drive(self.reservoir, [inputs])
        return states @ self.readout.T


def learn_response(
    reservoir: Reservoir, inputs: Array, outputs: Array, *, regulariser: float = 1e-6, washout: int = 100
) -> ReservoirResponse:
    """Trains the output signal (T, D) to an input signal (T, C) by ridge regression on the driven states.

    MotiondeckError if shapes do not fit, the washout leaves no frame, or a number is not finite.
    """
    given, wanted = time_series(inputs, "the input"), time_series(outputs, "the output")
    first = whole_number(washout, "washout")
    if not len(given) == len(wanted) > first:
        raise MotiondeckError(
            f"{len(given)} input and {len(wanted)} output frames with a washout of {first}: "
            "give equally many of both, and more than the washout"
        )
    (states,) = drive(reservoir, [given])
    return ReservoirResponse(reservoir, ridge(states[first:], wanted[first:], regulariser))


def _motions(
    signals: Mapping[str, Array], loops: Collection[str], washout: int
) -> tuple[list[TrainingMotion], Normalisation]:
    if not isinstance(signals, Mapping):  # what pyright sees, a user's script does not
        raise MotiondeckError(f"signals are {{name: array of shape (T, D)}}, not a {type(signals).__name__}")
    if not signals:
        raise MotiondeckError("there are no signals to learn")
    for name in loops:
        if name not in signals:
            raise MotiondeckError(f"loops names '{name}', which is not among the signals {', '.join(signals)}")
    series: dict[str, Array] = {}
    for name, signal in signals.items():
        channels = next(iter(series.values())).shape[1] if series else None
        series[name] = frames = time_series(signal, f"signal '{name}'", channels)
        if len(frames) < washout + 2:
            lead_in = f"{washout} of them lead in (washout), and " if washout else ""
            raise MotiondeckError(f"signal '{name}' has {len(frames)} frames, too few: {lead_in}2 at least are learned")
    normalisation = Normalisation.fit(list(series.values()))
    return [
        TrainingMotion(name, frames[washout:], name in loops, frames[:washout] if washout else None)
        for name, signal in series.items()
        for frames in [normalisation.apply(signal)]
    ], normalisation
