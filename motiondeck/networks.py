# pyright: strict
"""The networks themselves, for your own time series: reservoirs, conceptors, centers with satellites, switching.

Their equations are in the files of `controller/networks`.
"""

from controller.learning.centralized.motion_training import learn_primitive, train_centralized
from controller.learning.reservoirs.completion_training import CompletionRecipe, learn_completion
from controller.learning.reservoirs.conceptor_training import ConceptorRecipe
from controller.learning.signal_training import (
    SMALL_RESERVOIR,
    ReservoirResponse,
    learn_response,
    learn_signals,
    load_signals,
    run_free,
)
from controller.learning.trainers.centralized import CentralizedRecipe
from controller.learning.trainers.echo_state import EchoStateRecipe
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.learning.trainers.phase_echo_state import PhaseEchoStateRecipe
from controller.learning.trainers.shared_conceptor import SharedConceptorRecipe
from controller.learning.trainers.trainer import nrmse
from controller.networks.base import AnyNetwork, FrameNetwork, Generator, Morph
from controller.networks.centralized.centers import (
    Duffing,
    FrequencyError,
    HarmonicCenters,
    NonlinearCenters,
    Pendulum,
    Spring,
    control_for,
)
from controller.networks.centralized.centralized import CentralizedGenerator, CentralizedMotion
from controller.networks.centralized.low_rank import LowRankWeights
from controller.networks.centralized.movement_primitive import MovementPrimitive, ViaPoints
from controller.networks.centralized.satellite_network import SatelliteNetwork, learn_weights
from controller.networks.centralized.satellites import (
    GaussianSatellites,
    HarmonicSatellites,
    PolynomialSatellites,
    SatelliteError,
    Satellites,
    grid_places,
    lowest_orders,
    spacing,
)
from controller.networks.centralized.switching_design import ModuleDesign, SwitchingModuleError, design_module
from controller.networks.centralized.switching_module import Command, SwitchingModule, clamp, collapse_and_kick, excite
from controller.networks.conceptor.network import ConceptorNetwork
from controller.networks.echo_state.network import EchoStateNetwork
from controller.networks.phase_conceptor.network import PhaseConceptorNetwork
from controller.networks.phase_echo_state.network import PhaseEchoStateNetwork
from controller.networks.reservoirs.completion import Completion, LiveCompletion
from controller.networks.reservoirs.conceptor_algebra import (
    adapt_aperture,
    attenuation,
    conceptor,
    conjunction,
    correlation,
    disjunction,
    negation,
    quota,
    similarity,
)
from controller.networks.reservoirs.loaded_signals import LoadedSignals
from controller.networks.reservoirs.reservoir import Reservoir, drive, random_reservoir
from controller.networks.ridge import ridge
from controller.networks.shared_conceptor.network import SharedConceptorNetwork
from motiondeck_base.errors import MotiondeckError


def morph(network: AnyNetwork, source: str, target: str) -> Morph:
    """Inside a network that runs by itself: a morph that starts where it is in the source (Deliallisi 2017, eq. 3.16).

    MotiondeckError if it does not play the source, or a center drives it. UnknownNameError if there is no such motion.
    """
    if (autonomous := network.as_autonomous) is None:
        raise MotiondeckError(f"a {network.kind} network is not morphed; Library.morph mixes shared-conceptor loops")
    return autonomous.morph(source, target)


__all__ = ["AnyNetwork", "FrameNetwork", "Generator", "Morph", "morph", "nrmse", "ridge"]
__all__ += ["ConceptorNetwork", "EchoStateNetwork", "SharedConceptorNetwork"]
__all__ += ["PhaseConceptorNetwork", "PhaseEchoStateNetwork"]
__all__ += ["CentralizedRecipe", "ConceptorRecipe", "EchoStateRecipe"]
__all__ += ["PhaseEchoStateRecipe", "PhaseRecipe", "SharedConceptorRecipe"]
__all__ += ["SMALL_RESERVOIR", "Reservoir", "ReservoirResponse", "drive", "learn_response", "random_reservoir"]
__all__ += ["LoadedSignals", "learn_signals", "load_signals", "run_free"]
__all__ += ["Completion", "CompletionRecipe", "LiveCompletion", "learn_completion"]
__all__ += ["adapt_aperture", "attenuation", "conceptor", "correlation", "quota", "similarity"]
__all__ += ["conjunction", "disjunction", "negation"]
__all__ += ["Duffing", "FrequencyError", "HarmonicCenters", "NonlinearCenters", "Pendulum", "Spring", "control_for"]
__all__ += ["GaussianSatellites", "HarmonicSatellites", "PolynomialSatellites", "SatelliteError", "Satellites"]
__all__ += ["grid_places", "lowest_orders", "spacing"]
__all__ += ["CentralizedGenerator", "CentralizedMotion", "train_centralized"]
__all__ += ["LowRankWeights", "SatelliteNetwork", "learn_weights"]
__all__ += ["MovementPrimitive", "ViaPoints", "learn_primitive"]
__all__ += ["Command", "ModuleDesign", "SwitchingModule", "SwitchingModuleError"]
__all__ += ["clamp", "collapse_and_kick", "design_module", "excite"]
