"""A deck that replays a recording of a run at any tempo; it can be paused but not switched."""

from collections import deque

import numpy as np

from controller.deck.interfaces import PlacedPose
from controller.deck.switch import CommandedSwitch
from controller.deck.tempo import Paced
from controller.motion.rotations import Array, normalise
from controller.motion.skeleton import Pose
from controller.wire.messages.replies import Event
from controller.wire.run_recording import RunRecording
from motiondeck_base.errors import MotiondeckError


class RecordedDeck(Paced):
    """Plays the targets of a recording; what commands need of any deck is as in `Deck`; fits `run_phases.Player`.

    No network plays: what a deck has of one is empty or None here. If the recorded robot plays it, its root follows the
    recorded path. If it loops, it ends as it begins. MotiondeckError if the recording is empty.
    """

    activation = phase = phase_rate = lock_state = None
    phase_at: float | None = None
    settled, direct, restarts, fell_back = True, False, 0, ""

    def __init__(self, recording: RunRecording, *, same_robot: bool = True, loops: bool = False) -> None:
        if recording.ticks == 0:
            raise MotiondeckError("this recording is empty")
        super().__init__()
        fields = recording.fields
        self.motions = tuple(recording.description["motions"])
        self.time = 0.0
        self.switches: list[CommandedSwitch] = []
        self.way: list[str] = []
        self.queue: list[str] = []
        self.inputs: dict[str, float] = {}
        self.layered: dict[str, str] = {}
        self.events: deque[Event] = deque()
        self._rate = float(recording.description["rate"])
        self._targets, self._motion = fields["targets"], fields["playing"][:, 0]
        self._root, self._heading = fields["root_position"], np.unwrap(fields["heading"][:, 0])
        self._turn = fields["root_rotation"]
        self._robot_root = fields.get("robot_root") if same_robot else None
        # Recordings before version 5 do not say what was blended.
        self._blend = (fields["blend_motion"], fields["blend_weight"]) if "blend_motion" in fields else None
        self._last, self._loops = recording.ticks - 1, loops
        self._place = 0.0  # in ticks of the recording
        self.lead = 0.0  # how far it runs ahead of its joints, s
        self._waited = 0.0  # s since the end is reached

    @property
    def motion(self) -> str:
        """The motion that was played here."""
        return self.motions[int(self._motion[int(self._place)])]

    @property
    def playing(self) -> str:
        """The same as `motion`."""
        return self.motion

    @property
    def over(self) -> bool:
        """Whether the joints are at the end; the last targets are held there."""
        return self._place >= self._last and self._waited >= self.lead

    def update(self, dt: float) -> tuple[Array, Pose]:
        """Advances by dt seconds, linear between recorded ticks; the joint targets (J,), rad, and the pose."""
        self.time += dt
        self._waited = self._waited + dt if self._place >= self._last else 0.0
        step = dt * self.advance_tempo(dt) * self._rate
        place = self._place + step
        self._place = place % self._last if self._loops else min(max(place, 0.0), float(self._last))
        first = min(int(self._place), max(self._last - 1, 0))
        share, second = self._place - first, min(first + 1, self._last)

        def between(values: Array) -> Array:
            return (1.0 - share) * values[first] + share * values[second]

        def turned(values: Array) -> Array:
            near = values[second] if values[first] @ values[second] >= 0.0 else -values[second]
            return normalise((1.0 - share) * values[first] + share * near)

        pose = Pose(between(self._root), between(self._heading), turned(self._turn)[None])
        if self._robot_root is not None:
            place = np.concatenate([between(self._robot_root[:, :3]), turned(self._robot_root[:, 3:])])
            pose = PlacedPose(pose.root_position, pose.heading, pose.rotation, place)
        return between(self._targets), pose

    @property
    def blend(self) -> tuple[tuple[str, float], ...]:
        """The motions that were blended in here, each with its weight then."""
        if self._blend is None:
            return ()
        parts = zip(*(values[int(self._place)].tolist() for values in self._blend), strict=True)
        return tuple((self.motions[int(number)], weight) for number, weight in parts if number >= 0)
