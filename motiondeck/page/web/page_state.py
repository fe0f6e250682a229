"""What a run sends its page: once a description, and with every picture a snapshot and the arrays that are drawn."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Self

import msgspec

from controller.motion.rotations import Array
from controller.motion.skeleton import SkeletonInfo
from controller.wire.messages.deck_snapshot import DeckSnapshot
from hardware.rig.supervision.servo_states import ServoStates

STANDS_STILL, UNCERTAIN = "standing still", "nothing certain"


class ServoDescription(msgspec.Struct, frozen=True):
    """A servo of the rig: its limits, rad, and the highest temperature it bears, degC."""

    joint: str
    id: int
    model: str
    lower: float
    upper: float
    hottest: float


class RigDescription(msgspec.Struct, frozen=True):
    """The servos of a rig, their possible conditions, and how often the rig is written to, Hz."""

    conditions: list[str]
    rate_hz: float
    servos: list[ServoDescription]


class GhostDescription(msgspec.Struct, frozen=True):
    """The human whose motion a robot plays: model file, skeleton, and the robot's size beside it."""

    file: str
    skeleton: SkeletonInfo
    scale: float


class PageDescription(msgspec.Struct, frozen=True, kw_only=True):
    """A run as its page shows it; it does not change."""

    model_file: str  # of the robot
    robot: str
    motions: list[str]  # with `joints` and `recognizable` the names that a snapshot counts along
    follower_file: str | None = None  # of the robot that mirrors it
    rest: list[float] = []  # its qpos at rest; empty for the model's own
    joints: list[str] = []
    recognizable: list[str] = []
    unrecognized: str = STANDS_STILL  # what is shown while no motion is recognized
    command_port: int = 0
    direct: bool = False  # whether the deck switches and blends without motions in between
    has_phase: bool = False  # whether motions can be played backwards and sent to a phase
    network_file: str | None = None  # of the network that plays, if it can be looked into
    library_file: str | None = None  # of the library that it, or what it was baked from, is of
    verdicts: dict[str, tuple[str, str]] = {}  # by motion, whether the robot plays it: the answer, and with reasons
    learn: list[str] = []  # the command line of the process that learns a recording, if the page offers that
    groups: list[str] = []  # of joints that layers play on
    live: list[str] = []  # groups and joints that take live values
    gazes: bool = False  # whether it can look at a point
    behind_s: float = 0.0  # how late the human is shown, as the body follows it, s
    human: GhostDescription | None = None  # beside the robot, if its motion is known
    walks: bool = True  # whether its root moves, so that feet leave prints and a camera follows
    weight: float | None = None  # of a robot that stands on the floor alone, N
    push_ns: float = 0.0  # a push that forces a step, N s; 0 if the body cannot be pushed
    rig: RigDescription | None = None
    shapes: dict[str, list[int]] = {}  # of the arrays of each picture, by the names of `PictureArrays`


@dataclass(frozen=True)
class PictureArrays:
    """The arrays of a picture; None for what a run does not have."""

    qpos: Array  # MuJoCo's generalised positions of the robot, shape (nq,)
    follower: Array | None = None  # those of the robot that mirrors it
    human_root: Array | None = None  # of the played human, shape (3,), m
    human_rotation: Array | None = None  # of its root and bones in the world, shape (1 + B, 4)
    human_offsets: Array | None = None  # as `Pose.offsets`, shape (B, 3), m; 0 if not known
    target: Array | None = None  # the qpos that simulated servos are to reach
    # Points where the floor holds the body, m, and the forces there, N, shape (N, 6); NaN for none.
    contacts: Array | None = None
    activation: Array | None = None  # of the network's neurons, shape (N,)
    bus: Array | None = None  # for how long the rig's busiest port has been busy so far, shape (1,), s
    servos: Array | None = None  # the rows of `ServoStates`, shape (8, S)

    @property
    def shapes(self) -> dict[str, list[int]]:
        """The shape of each array."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: list(array.shape) for name, array in arrays.items() if array is not None}

    @property
    def sizes(self) -> dict[str, int]:
        """How many numbers each array has."""
        return {name: getattr(self, name).size for name in self.shapes}

    @classmethod
    def over(cls, shared: Mapping[str, Array], shapes: Mapping[str, list[int]]) -> Self:
        """Views of the fields of a shared state."""
        return cls(**{name: shared[name].reshape(shape) for name, shape in shapes.items()})


@dataclass(frozen=True)
class Picture:
    """One published state of a run."""

    snapshot: DeckSnapshot
    arrays: PictureArrays

    @property
    def servos(self) -> ServoStates | None:
        """The states of the rig's servos; None without a rig, or before it has been heard."""
        rows = self.arrays.servos
        return ServoStates(*rows) if rows is not None else None
