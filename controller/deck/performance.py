"""Plays one motion, or a blend of two, and joins motions without a jump.

    track -> posture (or two of them -> blend) -> fade of the last switch -> limits of a join -> root path -> pose

It does what it is told at once; when a motion is played is decided by the deck.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from controller.deck.joins.blend_check import BlendCheck
from controller.deck.joins.blend_weight import Crossing, ModuleWeight, Ramp, Weight
from controller.deck.joins.deck_motions import Motion, read_motions, tempos_in_step
from controller.deck.joins.fade_search import PLANNED_SHARE, Bounds, FadeSearch
from controller.deck.joins.fading import Fading
from controller.deck.joins.join_limits import FASTEST, JoinLimits
from controller.deck.joins.joining import Joining
from controller.deck.joins.posture_blend import PostureBlend
from controller.deck.joins.transition import best_anchor, difference, extrapolated
from controller.deck.root_path import advance, at_origin
from controller.deck.tracks.track import Track
from controller.library.motion_library import MotionLibrary
from controller.mocap.encodings.bone_directions import BoneDirections
from controller.mocap.posture import Pose, Posture
from controller.networks.base import Activation
from controller.networks.centralized.centralized_frames import CentralizedNetwork
from controller.networks.reservoirs.morph import ReservoirNetwork
from controller.rotations import Array

# A difference in joint velocity counts as much as the distance it covers in this time (8 frames at 120 Hz), s.
VELOCITY_REACH = 8.0 / 120.0

# How long it takes to change the blend weight from 0 to 1, or a network from one motion to another, s.
MORPH_SECONDS = 1.0

# How often a join that becomes too fast is replaced by a longer fade.
MOST_CORRECTIONS = 6

# From which share of the limits of a join on it is replaced: halfway from what a fade means to use to all of them. One
# that uses no more than it means to is left alone: replaced while it speeds up, a body would swing farther still.
CORRECTED_FROM = 0.5 * (PLANNED_SHARE + 1.0)

# Between which shares of the limits a blend weight changes more and more slowly, how slowly at least, and how soon, s.
EASED_FROM, EASED_TO, SLOWEST, EASING_SECONDS = 0.7, 0.8, 0.2, 0.1

# While the weight of a blend changes, it is given up beyond so many times the limits of a join.
BLEND_TURNS_OVER = 2.0


class Performance:
    """Plays one motion of a library, or a blend of two.

    A tick is one `step`, perhaps a `switch_to` or `blend_in`, and in the end `show`.

    Attributes:
        motions: the motions of the library by name.
        posture: the posture that is shown.
        pose: the same in the world.
        blend_problem: the problem of the blend in the last step, or "".
    """

    def __init__(self, library: MotionLibrary, motion: str, joining: Joining | None, phase: float = 0.0) -> None:
        """Begins with a motion of the library at a phase in [0, 1); `joining` as for the deck."""
        self.motions = read_motions(library)
        self._names = library.network.motions
        self._skeleton = library.encoding.skeleton
        twist_by_rule = type(library.encoding) is BoneDirections
        self._rest_direction = library.encoding.skeleton.rest_direction if twist_by_rule else None
        self._by_module = isinstance(library.network, CentralizedNetwork)
        self._morphs_inside = isinstance(library.network, ReservoirNetwork)
        self._joining: Joining = joining or ("morph" if self._by_module else "inertialise")
        # A blend plays both; in a switch by mixing the second is the one that is entered.
        self._first, self._second = Track(library, self.motions), Track(library, self.motions)
        self._blend: PostureBlend | None = None
        self._weight: Weight = Ramp(0.0, 0.0, 0.0)
        self._weight_pace = 1.0  # of the weight, which changes more slowly where joints become too fast
        self._switching = False  # whether a switch is under way that mixes or morphs
        self._check: BlendCheck | None = None
        self.blend_problem = ""
        self._fade: Fading | None = None
        self._limits: JoinLimits | None = None
        self._corrections = 0
        self._dt, self._tempo = 1.0 / library.info.rate, 1.0
        self._first.cue_phase(motion, phase)
        self._first.step(0.0, 1.0)
        self._before = self.posture = self._shown = self._target = self._first.posture
        self.pose = self._next = at_origin(self.posture)
        self._pose_before: Pose | None = None
        self._joints(self.posture)  # what its skeleton finds once it finds before the first tick

    @property
    def here(self) -> Motion:
        """The motion that is played, or being switched to."""
        return self._leading.motion

    @property
    def fading(self) -> bool:
        """Whether the last switch is still under way."""
        return self._fade is not None or self._switching

    @property
    def crossing(self) -> bool:
        """Whether the blend weight is still changing, or what it has led to is not yet one motion alone."""
        if self._blend is None or self._weight.changing:
            return self._blend is not None
        return self._blend.settling and self._weight.value in (0.0, 1.0)

    @property
    def other(self) -> str:
        """The second motion of the blend, or ""."""
        return self._second.motion.name if self._blend is not None and not self._switching else ""

    @property
    def blend(self) -> tuple[str, float] | None:
        """The motion that is blended into the one that is played, and its present weight."""
        return (self.other, self._weight.value) if self.other else None

    @property
    def activation(self) -> Activation | None:
        """The activation of the neurons of the network that leads, shape (N,); None if it has none to look at."""
        return self._leading.activation

    @property
    def phase(self) -> float | None:
        """How far the motion is: [0, 1) in a loop, 0 to 1 in a one-shot; None if the network runs by itself."""
        return self._leading.phase

    @property
    def inputs(self) -> dict[str, tuple[float, float]]:
        """The inputs that the network has besides the phase, and between which values each was learned."""
        return self._first.inputs

    def set_input(self, name: str, value: float) -> None:
        """Gives an input of the network another value."""
        for track in (self._first, self._second):
            track.set_input(name, value)

    def require_phase(self) -> None:
        """Checks that the network has a phase.

        Raises:
            MotiondeckError: if it runs by itself.
        """
        self._first.require_phase()

    @property
    def restarts(self) -> int:
        """How often the network lost its motion and was restarted."""
        return self._first.restarts + self._second.restarts

    @property
    def at_end(self) -> bool:
        """Whether the motion has ended or gone round."""
        return self._leading.ended

    @property
    def ended(self) -> bool:
        """Whether the motion has ended or gone round, and nothing is faded or changing its weight."""
        return self.at_end and not self.fading and not self.crossing

    def finish_round(self) -> None:
        """Sets the end of a loop that has gone round to the end of its present round."""
        self._leading.finish_round()

    def step(self, dt: float, tempo: float) -> bool:
        """Advances by dt seconds at a tempo; whether a switch has been completed with it."""
        self._dt, self._tempo = dt, tempo
        self._target = self._play(dt, tempo)
        shown, completed = self._target, False
        if self._fade is not None or self._switching:
            shown, completed = self._faded(dt)
        self.blend_problem = ""
        blending = self._blend is not None and not self._switching
        if blending and self._check is not None:
            self.blend_problem = self._check.problem(self._joints(self._target), dt * abs(tempo))
        self._take(shown)
        # Played faster, the motions themselves go beyond what they need at their own tempo.
        use = self._limits.use(self._next, dt) / max(1.0, abs(tempo)) if self._limits is not None else 0.0
        if self.crossing:
            wanted = 1.0 - (use - EASED_FROM) / (EASED_TO - EASED_FROM)
            self._weight_pace += (min(max(wanted, SLOWEST), 1.0) - self._weight_pace) * min(1.0, dt / EASING_SECONDS)
        if blending and use > BLEND_TURNS_OVER:
            self.blend_problem = "turns over"
        elif not blending and use > CORRECTED_FROM and self._corrections < MOST_CORRECTIONS:
            self._take(extrapolated(self._before, self.posture, dt, self._rest_direction))
            self._fade_instead()
        if self.blend_problem == "turns over":
            self._take(extrapolated(self._before, self.posture, dt, self._rest_direction))
        restarted = self._first.restarted() if self._first.guarded else None
        if restarted is not None and self._blend is None:
            self._first.restart_at(restarted)
            self._fade_to_first(self.here)
        return completed

    def show(self) -> Pose:
        """Shows what this tick has led to; the pose in the world."""
        self._before, self.posture = self.posture, self._shown
        self._pose_before, self.pose = self.pose, self._next
        if self._limits is not None:
            self._limits.accept(self.pose)
            if not self.fading and not self.crossing:
                self._limits = None
        return self.pose

    def switch_to(self, motion: str) -> None:
        """Starts a motion where it resembles the body most, and the join from what is shown to it.

        While another switch is under way, or two motions are blended, the join is a fade.
        """
        leaving, entering, joining = self.here, self.motions[motion], self._joining
        anchor = self._best_anchor(motion, self.posture, self._shown)
        self._limit(leaving, entering)
        if joining in ("morph", "crossfade") and not self.fading and self._blend is None:
            if joining == "morph" and self._morphs_inside:
                self._first.morph(motion, anchor, MORPH_SECONDS)
            else:
                self._mix_to(motion, anchor)
            self._switching = True
            return
        self._blend, self._switching = None, False
        self._first.cue(motion, anchor)
        if joining == "cut":
            self._fade, self._limits = None, None
            self._switching = True  # completed in the next step
        else:
            self._fade_to_first(leaving, entering)

    def jump(self, phase: float) -> None:
        """Goes to a phase in [0, 1] of the motion that is played, and fades from what is shown to it."""
        motion = self.here
        self._limit(motion)
        self._blend, self._switching = None, False
        self._first.cue_phase(motion.name, phase)
        self._fade_to_first(motion)

    def blend_in(self, other: str, weight: float) -> None:
        """Blends another motion in, or changes its weight, at MORPH_SECONDS for a weight of 1."""
        if self._blend is None:
            self._check = BlendCheck(self.here, self.motions[other])
            self._second.cue(other, self._best_anchor(other, self._before, self.posture))
            self._second.step(0.0, self._tempo)
            self._blend = PostureBlend(self._first.posture, self._second.posture, self._rest_direction)
            self._weight = Ramp(0.0, 0.0, 0.0)
        self._limit(self.here, self.motions[other])
        present = self._weight.value
        self._weight = Ramp(present, weight, abs(weight - present) * MORPH_SECONDS)

    def finish_blend(self) -> None:
        """Drops the motion whose weight has become 0, if one has."""
        if self._weight.value == 1.0:
            self._first, self._second = self._second, self._first
        if self._weight.value in (0.0, 1.0):
            self._blend = None

    @property
    def _leading(self) -> Track:
        return self._second if self._switching and self._blend is not None else self._first

    def _play(self, dt: float, tempo: float) -> Posture:
        """The posture of the motion, or of both, dt seconds later."""
        if self._blend is None:
            onset = self._fade.onset if self._fade is not None and not self.here.loop else 1.0
            return self._first.step(dt, tempo * onset)
        weight = self._weight.advance(dt * self._weight_pace)
        tempos = (1.0, 1.0)
        if not self._switching:
            tempos = tempos_in_step(self._first.motion, self._second.motion, weight)
        first, second = self._first.step(dt, tempo * tempos[0]), self._second.step(dt, tempo * tempos[1])
        return self._blend.advance(first, second, weight, dt)

    def _faded(self, dt: float) -> tuple[Posture, bool]:
        """The target with what is left of the last switch, and whether the switch is now complete."""
        target = self._target
        if self._fade is not None:
            self._fade.advance(dt, float(target.turn_rate))
            if self._fade.lasts:
                return self._fade.shown(target), False
            self._fade = None
            return target, True
        if self.crossing or self._first.morphing:
            return target, False
        if self._blend is not None:
            self.finish_blend()
        self._switching = False
        return target, True

    def _take(self, shown: Posture) -> None:
        """Takes a posture for the one of this tick."""
        self._shown, self._next = shown, advance(self.pose, shown, self._dt)

    def _limit(self, *motions: Motion) -> None:
        """Limits the join that begins, by these motions and by those of a join still under way."""
        if self._limits is None:
            self._limits = JoinLimits(self._skeleton, self._pose_before, self.pose)
            self._weight_pace = 1.0
        self._limits.begin(*motions)
        self._corrections = 0

    def _mix_to(self, motion: str, anchor: int) -> None:
        """Enters a motion on the second track, and mixes both until it is left alone."""
        leaving, entering = self.here, self.motions[motion]
        by_module = self._by_module and self._joining == "morph"
        self._second.cue(motion, anchor)
        if not by_module:
            self._second.step(0.0, self._tempo)  # for the search: what comes before
        now = self._second.step(self._dt, self._tempo)
        self._blend = PostureBlend(self._first.posture, now, self._rest_direction)
        if by_module:
            self._weight = ModuleWeight(len(self._names), *map(self._names.index, (leaving.name, motion)))
        else:
            self._weight = Crossing(self._search(self._second, leaving, entering))

    def _fade_to_first(self, *motions: Motion) -> None:
        """Fades from what is shown to the motion of the first track, which has just been cued."""
        tempo = self._tempo if self.here.loop else 0.0
        self._first.step(0.0, tempo)
        self._first.step(self._dt, tempo)
        self._begin_fade(self._first, *motions)

    def _fade_instead(self) -> None:
        """Replaces a join that has become too fast by a fade from here to its target."""
        self._corrections += 1
        track = self._leading
        if self._blend is not None:
            self._first, self._second = self._second, self._first
            self._blend = None
        elif track.morphing:
            track.cue(track.motion.name, self._best_anchor(track.motion.name, self.posture, self._shown))
            track.step(0.0, self._tempo)
            track.step(self._dt, self._tempo)
        self._switching = False
        self._begin_fade(track, track.motion)

    def _begin_fade(self, track: Track, *motions: Motion) -> None:
        self._fade = Fading(self._search(track, *motions))

    def _search(self, track: Track, *motions: Motion) -> FadeSearch:
        """Finds the fade from what is shown to the motion of a track, bounded by what these motions do themselves."""
        speed, acceleration = (max(getattr(motion, name) for motion in motions) for name in ("speed", "acceleration"))
        shown, target = (self.posture, self._shown), (track.posture_before, track.posture)
        return FadeSearch(
            partial(difference, shown, target, self._dt, self._rest_direction),
            track.ahead(self._tempo, starting=not track.motion.loop),
            self._skeleton.chain,
            Bounds(FASTEST * speed, acceleration),
        )

    def _best_anchor(self, motion: str, before: Posture, now: Posture) -> int:
        """The anchor where a motion resembles a body most."""
        entering, place = self.motions[motion], self._joints(now)
        velocity = (place - self._joints(before)) / self._dt
        return best_anchor(place, velocity, entering.places, entering.velocities, VELOCITY_REACH)

    def _limbs(self, rotation: Array) -> Array:
        """Positions of root and joints relative to the root, of rotations (..., 1 + B, 4), m."""
        return self._skeleton.joints(np.zeros((*rotation.shape[:-2], 3)), rotation)

    def _joints(self, posture: Posture) -> Array:
        """Joint positions relative to the root in the heading frame, and the root's height, shape (F,), m."""
        return np.append(self._limbs(posture.rotation)[1:].ravel(), posture.height)
