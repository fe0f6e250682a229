"""A person in the motions of a library: which they do, where in it and how fast, from a few points of their body.

A rig that is moved by hand leads likewise, by the angles of some joints: these are heights of points, ARM m for 1 rad.
The library's own motions, as its network plays them, are what the points are compared with (`phase_filter`).
"""

from collections.abc import Mapping, Sequence

import numpy as np

from controller.deck.joins.deck_motions import Motion, read_motions
from controller.deck.motion_generator import MotionGenerator
from controller.deck.person_body import Learn, PersonBody, body_rows, paired
from controller.deck.phase_filter import RATE, PhaseFilter
from controller.library.motion_library import MotionLibrary
from controller.motion.clip import FARTHEST
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.rotations import Array, rotate, yaw
from controller.motion.skeleton import walk_path
from motiondeck_base.errors import MotiondeckError, UnknownNameError

ROOT = "root"
ARM = 0.35  # m
SURE = 0.8  # the probability from which another motion counts
FOR_STEPS = 6  # and for how many steps in a row


class PersonFollower:
    """Follows named points, joints of the library's body or `root`, of a person of some height, m; or a rig's joints.

    What learns completes the person's body, where some points are left and right of each other; `body` has it.

    UnknownNameError for a point that the body lacks. MotiondeckError for a network without a phase, or a wrong height.
    """

    def __init__(
        self, library: MotionLibrary, points: Sequence[str], height: float | None = None, learn: Learn | None = None
    ) -> None:
        skeleton = library.encoding.skeleton
        own = UnknownNameError.indices("point", points, (ROOT, *skeleton.bones))
        if library.network.as_phase_network is None:
            raise MotiondeckError("the network of this library has no phase that could follow a person")
        if height is not None and (skeleton.is_rig or not 0.5 <= height <= 2.5):
            raise MotiondeckError(
                f"a person of {height:g} m; give their height in metres, from 0.5 to 2.5; a rig has none"
            )
        motions = [read_motions(library)[name] for name in library.network.motions]
        bodies = [body_course(library, motion) for motion in motions]
        self._scale = ARM if skeleton.is_rig else skeleton.stature / height if height is not None else 1.0
        loops = [motion.loop for motion in motions]
        self._steps = [len(turns) // (3 if loop else 1) for (_, turns), loop in zip(bodies, loops, strict=True)]
        self._filter = PhaseFilter([body[:, own] for body, _ in bodies], [heading for _, heading in bodies], loops)
        self._motions, self._points = motions, tuple(points)
        self.body: tuple[float, ...] = ()  # as of the last step, for `Deck.follow`; nothing if it is not known
        self._body: PersonBody | None = None
        if learn is not None and paired(points) and not skeleton.is_rig:
            rounds = [(joints[:n], turn[:n]) for (joints, turn), n in zip(bodies, self._steps, strict=True)]
            courses = [(joints[:, own], body_rows(skeleton, joints, turn)) for joints, turn in rounds]
            self._body = PersonBody(points, courses, learn)
        self._shown, self._other = -1, 0  # the motion that counts, and the steps for which another is sure
        self._near: float | None = None  # the frame that is expected next

    def step(self, seen: Mapping[str, Sequence[float]]) -> tuple[str, float, float] | None:
        """Goes on by 1 / RATE s with points in the world, m, z up: the motion, phase and tempo, once they are known.

        The z of a rig's joint is its angle, rad.
        """
        measured = np.array([seen.get(point, (np.nan,) * 3) for point in self._points], dtype=float)
        measured[~(np.abs(measured) < FARTHEST)] = np.nan
        measured *= self._scale
        self._filter.step(measured)
        if self._body is not None:
            self.body = ()
            if (rows := self._body.step(measured)) is not None:
                # Where the body stands and faces is not led: it goes on along the path of the motion.
                rows[1, :2] = 0.0
                own = rotate(yaw(-np.arctan2(rows[0, 1], rows[0, 0])), rows[1:])
                self.body = self._filter.share, *own.round(3).ravel().tolist()
        best = self._filter.place()
        self._other = self._other + 1 if best.motion != self._shown and best.evidence >= SURE else 0
        if self._other >= FOR_STEPS:
            self._shown, self._near = best.motion, None
        if self._shown < 0:
            return None
        place, motion = self._filter.place(self._shown, self._near), self._motions[self._shown]
        self._near = place.frame + place.tempo
        phase = place.frame / self._steps[self._shown]
        return motion.name, phase % 1.0 if motion.loop else min(max(phase, 0.0), 1.0), place.tempo


def body_course(library: MotionLibrary, motion: Motion) -> tuple[Array, Array]:
    """The joints of a motion in the world, at RATE: (T, 1 + B, 3), m, and its headings (T,); of a loop three rounds.

    Of a rig they are at the heights that stand for its angles.
    """
    seconds = motion.seconds if motion.loop else motion.whole
    steps = max(2, round(seconds * RATE))
    playing, dt = MotionGenerator(library, motion.name), seconds / steps
    rows = [playing.step(dt if row else 0.0) for row in range(3 * steps if motion.loop else steps)]
    pose = walk_path(library.encoding.decode(np.array(rows)), dt)
    if library.encoding.skeleton.is_rig:
        heights = ARM * np.pad(angles_of(pose.rotation[:, 1:]), ((0, 0), (1, 0)))
        return heights[..., None] * [0.0, 0.0, 1.0], pose.heading
    return library.encoding.skeleton.joints(pose.root_position, pose.rotation), pose.heading
