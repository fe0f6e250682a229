"""A small body and three motions made up for tests, so that everything but the readers runs without recordings."""

from copy import deepcopy
from functools import wraps

import msgspec
import numpy as np

from controller.learning.preparation.loops import hold_end
from controller.learning.preparation.training_motion import Lessons, TrainingMotion
from controller.learning.reservoirs.conceptor_training import ConceptorRecipe, conceptor_network, load_reservoir
from controller.learning.trainers.centralized import CentralizedRecipe
from controller.learning.trainers.clip import ClipRecipe
from controller.learning.trainers.echo_state import EchoStateRecipe
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.learning.trainers.phase_echo_state import PhaseEchoStateRecipe
from controller.learning.trainers.shared_conceptor import SharedConceptorRecipe
from controller.learning.trainers.trainer import trainer_of
from controller.learning.training_set import TrainingSet
from controller.library.motion_library import VERSION, LibraryInfo, MotionInfo, MotionLibrary
from controller.motion.encodings.bone_directions import BoneDirections
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.skeleton import Skeleton
from controller.networks.phase_conceptor.network import PhaseConceptorNetwork

RATE = 120.0
RIGHT, LEFT, UP, DOWN = (0, -1, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)
BODY = (
    ("rhip", -1, RIGHT, 0.1),
    ("rleg", 0, DOWN, 0.8),
    ("lhip", -1, LEFT, 0.1),
    ("lleg", 2, DOWN, 0.8),
    ("back", -1, UP, 0.5),
    ("head", 4, UP, 0.2),
    ("rarm", 4, RIGHT, 0.6),
    ("larm", 4, LEFT, 0.6),
)
SMALL_RECIPE = ConceptorRecipe(neurons=300, input_scale=0.5, aperture=100.0, ridge=0.01, rank=30, washout=60)


def small_skeleton():
    names, parents, directions, lengths = zip(*BODY, strict=True)
    return Skeleton("small", names, np.array(parents), np.array(directions, dtype=float), np.array(lengths))


SMALL_SHARED = {"neurons": 300, "rank": 30, "piece_seconds": 5.0}
SMALL_PHASE = {"neurons": 200, "rank": 30}


def small_encoding():
    return BoneDirections(small_skeleton())


def swing(angle, axis):
    """Unit vectors (T, 3) that hang down and swing by angle (T,) along an axis, 0 = forward, 1 = left."""
    out = np.zeros((len(angle), 3))
    out[:, axis], out[:, 2] = np.sin(angle), -np.cos(angle)
    return out


def frames_of(height, forward, turn, legs, arms):
    """Channels (T, 28) of a body whose right and left legs and arms point along four arrays (T, 3)."""
    count = len(height)
    channels = np.zeros((count, small_encoding().channels))
    channels[:, 0], channels[:, 1], channels[:, 2] = height, turn, forward
    fixed = {"rhip": RIGHT, "lhip": LEFT, "back": UP, "head": UP}
    moving = {"rleg": legs[0], "lleg": legs[1], "rarm": arms[0], "larm": arms[1]}
    for bone, (name, *_rest) in enumerate(BODY):
        channels[:, 4 + 3 * bone : 7 + 3 * bone] = fixed.get(name, moving.get(name))
    return channels


def march(period=96):
    t = 2 * np.pi * np.arange(period) / period
    legs = swing(0.6 * np.sin(t), 0), swing(-0.6 * np.sin(t), 0)
    arms = swing(-0.7 * np.sin(t), 0), swing(0.7 * np.sin(t), 0)
    return frames_of(0.8 + 0.03 * np.cos(2 * t), 1.2 + 0.1 * np.cos(2 * t), 0.2 * np.sin(t), legs, arms)


def wave(period=120):
    t = 2 * np.pi * np.arange(period) / period
    legs = swing(-0.2 + 0 * t, 1), swing(0.2 + 0 * t, 1)
    arms = swing(-2.2 + 0.6 * np.sin(t), 1), swing(2.2 + 0.6 * np.cos(t), 1)
    return frames_of(0.8 + 0 * t, 0 * t, 0 * t, legs, arms)


def bow(count=150):
    s = 0.5 - 0.5 * np.cos(np.pi * np.arange(count) / (count - 1))
    legs = swing(1.2 * s, 0), swing(1.2 * s, 0)
    arms = swing(-0.4 + 0 * s, 1), swing(1.5 * s, 0)
    return hold_end(frames_of(0.8 - 0.4 * s, 0 * s, 0 * s, legs, arms), slice(1, 4), RATE)


MOTIONS = {"march": march, "wave": wave, "bow": bow}
LOOPS = {"march": True, "wave": True, "bow": False}


def references():
    return {name: make() for name, make in MOTIONS.items()}


def training_set():
    return TrainingSet(small_encoding(), RATE, references(), LOOPS)


def judge():
    return training_set().judge


def lessons():
    frames = references()
    normalisation = Normalisation.fit(list(frames.values()))
    return [TrainingMotion(name, normalisation.apply(f), LOOPS[name]) for name, f in frames.items()], normalisation


def trained(recipe, motions=None, normalisation=None, seed=0):
    """The network of a recipe, untested; by default of `lessons`."""
    if motions is None:
        motions, normalisation = lessons()
    return trainer_of(recipe).train(recipe, Lessons(motions, normalisation, RATE), seed)


def learned_once(learn):
    """What a function learned, a copy for each caller: as many tests ask for it, but for the first it costs little."""
    learned = {}

    @wraps(learn)
    def copied(*arguments, **recipe):
        asked = repr((arguments, recipe))
        if asked not in learned:
            learned[asked] = learn(*arguments, **recipe)
        return deepcopy(learned[asked]).twin()  # whose state and readout share memory again

    return copied


@learned_once
def small_network(seed=0, recipe=SMALL_RECIPE):
    taught, normalisation = lessons()
    return conceptor_network(load_reservoir(taught, recipe, seed), Lessons(taught, normalisation, RATE), recipe)


@learned_once
def small_phase_network(seed=0, **recipe):
    taught, normalisation = lessons()
    network = trained(PhaseRecipe(**(SMALL_PHASE | recipe)), taught, normalisation, seed=seed)
    assert isinstance(network, PhaseConceptorNetwork)
    return network


@learned_once
def small_phase_echo_state(seed=0, **recipe):
    """The same motions in a phase-driven echo-state network."""
    taught, normalisation = lessons()
    return trained(PhaseEchoStateRecipe(**recipe), taught, normalisation, seed=seed)


@learned_once
def small_shared_conceptor(**recipe):
    """The same motions in conceptors that share their weights."""
    return trained(SharedConceptorRecipe(**(SMALL_SHARED | recipe)))


@learned_once
def small_echo_state(**changes):
    return trained(EchoStateRecipe(neurons=150, washout=60, drives=1, **changes))


@learned_once
def small_centralized(satellites=20):
    return trained(CentralizedRecipe(centers=1, satellites=satellites, iterations=2))


NETWORKS = {
    "conceptor": small_network,
    "echo-state": small_echo_state,
    "echo-state of the thesis": lambda: small_echo_state(clipped=False),
    "phase-conceptor": lambda: small_phase_network(piece_seconds=0.5),
    "phase-echo-state": lambda: small_phase_echo_state(piece_seconds=0.5),
    "shared-conceptor": lambda: small_shared_conceptor(readout="shared"),
    "shared-conceptor in pieces": lambda: small_shared_conceptor(piece_seconds=0.5),
    "centralized": small_centralized,
    "clip": lambda: trained(ClipRecipe()),
}
"""Small networks of every kind, made when called; the phase-driven ones play `bow` and `wave` in pieces."""


def run(network, frames):
    """The channels that a network plays from where it is, shape (frames, channels)."""
    out = np.empty((frames, network.channels))
    for frame in out:
        network.advance(frame)
    return out


def small_phase_library(seed=0, **recipe):
    """The same motions in phase-driven conceptors."""
    return _phase_driven("phase-conceptor", small_phase_network(seed, **recipe), seed)


def small_phase_echo_state_library(seed=0, **recipe):
    """The same motions in a phase-driven echo-state network."""
    return _phase_driven("phase-echo-state", small_phase_echo_state(seed, **recipe), seed)


def _phase_driven(kind, network, seed):
    library = small_library(seed)
    info = msgspec.structs.replace(library.info, network=kind, scales=network.scales)
    return MotionLibrary(info, network, library.encoding)


def small_library(seed=0):
    """Two loops and a one-shot, in a network of 300 neurons."""
    encoding = small_encoding()
    motions = [
        MotionInfo(
            name=name,
            plays="once" if name == "bow" else "loop",
            frames=len(frames),
            source="synthetic",
            nrmse=0.01,
            error_mm=5.0,
            passed=True,
        )
        for name, frames in references().items()
    ]
    info = LibraryInfo(
        version=VERSION,
        name="small",
        network="conceptor",
        encoding="bone directions",
        rate=RATE,
        seed=seed,
        motions=motions,
        skeleton=encoding.skeleton_info(),
        recipe={},
        licence="none needed",
        acknowledgement="",
    )
    return MotionLibrary(info, small_network(seed), encoding)
