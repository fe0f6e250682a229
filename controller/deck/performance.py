"""Plays one motion, or a blend of several, and joins motions without a jump.

    tracks -> posture -> fade of the last switch -> limits of a join -> root path -> pose

It acts at once; `switch_plan` decides what is played when. The ways from one motion to another:

- inertialise: the new motion starts at once where it resembles the body most, and the difference fades (`transition`);
- crossfade: both motions run, and the weight of the new one rises smoothly;
- morph: the network itself changes from one to the other, as its paper defines it (mu of conceptors or readouts);
- cut: the new motion starts at once with a jump; the safety envelope catches up.

By default networks with a switching module of their own morph, and all others inertialise. While another switch is
under way or motions are blended, every switch inertialises.
"""

from collections.abc import Mapping
from functools import partial
from math import cos, sin
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from controller.deck.joins.deck_motions import Motion, read_motions
from controller.deck.joins.fade_search import PLANNED_SHARE, FadeSearch, Fading
from controller.deck.joins.join_limits import FASTEST, Bounds, JoinLimits
from controller.deck.joins.transition import Fade, difference, entry_costs, extrapolated
from controller.deck.tracks.playing_tracks import PlayingTracks
from controller.deck.tracks.track import Track
from controller.library.motion_library import MotionLibrary
from controller.motion.rotations import Array, multiply, yaw
from controller.motion.skeleton import Pose, Posture

Joining = Literal["inertialise", "crossfade", "morph", "cut"]
JOININGS: tuple[Joining, ...] = get_args(Joining)
# A difference in joint velocity counts as much as the distance it covers in this time (8 frames at 120 Hz), s.
VELOCITY_REACH = 8.0 / 120.0
MORPH_SECONDS = 1.0  # in which the blend weight changes from 0 to 1, or a network from one motion to another
# From which share of the limits of a join on it is replaced: halfway from what a fade means to use to all of them. One
# that uses no more than it means to is left alone: replaced while it speeds up, a body would swing farther still.
CORRECTED_FROM = 0.5 * (PLANNED_SHARE + 1.0)
# By how much more of the limits a join has to need to be replaced again: the fade that replaces it takes its time too.
CORRECTED_AGAIN = 0.05
# Between which shares of the limits a blend weight changes more and more slowly, how slowly at least, and how soon, s.
EASED_FROM, EASED_TO, SLOWEST, EASING_SECONDS = 0.7, 0.8, 0.2, 0.1
BLEND_TURNS_OVER = 2.0  # a blend whose weights change is given up beyond this multiple of the limits of a join


class Performance:
    """Plays one motion of a library, or a blend of up to MOST_BLENDED.

    A tick is one `step`, perhaps a `switch_to` or `blend_in`, and in the end `finish_tick`.
    """

    _searches = FadeSearch

    def __init__(self, library: MotionLibrary, motion: str, joining: Joining | None, phase: float = 0.0) -> None:
        self.motions = read_motions(library)
        self._skeleton = library.encoding.skeleton
        self._by_module = library.network.by_module
        self._morphs_inside = library.network.as_autonomous is not None
        self._joining: Joining = joining or ("morph" if self._by_module else "inertialise")
        # The tracks that play; `tracks.leading` has the phase and the inputs.
        self.tracks = PlayingTracks(library, self.motions)
        self._weight_pace = 1.0  # of blend weights, which change more slowly where joints become too fast
        self.blend_problem = ""  # the problem of the blend in the last step, or ""
        self._switching = False  # whether a switch is under way that is no fade
        self._fade: Fading | None = None
        self._search: FadeSearch | None = None
        self._limits: JoinLimits | None = None
        self._correct_from = CORRECTED_FROM
        self._dt, self._tempo = 1.0 / library.info.rate, 1.0
        first = self.tracks.playing[0]
        first.cue_phase(motion, phase)
        first.step(0.0, 1.0)
        self._before = self.posture = self._shown = first.posture
        self._body_goal = self._body_shown = self.motions[motion].offsets
        self._body: Fade | None = None  # what is left of the difference to that goal, and for how long, s
        self._body_elapsed = 0.0
        self.pose = self._next = at_origin(self.posture)
        self.pose.offsets = self._body_shown
        self._pose_before: Pose | None = None
        self._joints(self.posture)  # what its skeleton finds once it finds before the first tick

    @property
    def motion(self) -> Motion:
        """The motion that is played, or being switched to."""
        return self.tracks.leading.motion

    @property
    def fading(self) -> bool:
        """Whether the last switch is under way."""
        return self._fade is not None or self._switching

    @property
    def ended(self) -> bool:
        """Whether the motion has ended or gone round, and nothing is faded or changing its weight."""
        return self.tracks.leading.ended and not self.fading and not self.tracks.crossing

    def step(self, dt: float, tempo: float) -> bool:
        """Advances by dt seconds at a tempo; whether a switch has been completed with it."""
        self._dt, self._tempo, tracks = dt, tempo, self.tracks
        target = tracks.step(dt, tempo if self._fade is None else tempo * self._onset, self._weight_pace)
        shown, completed = self._faded(target)
        self.blend_problem = tracks.problem(self._joints(target), dt, tempo) if tracks.blending else ""
        self._shown, self._next = shown, advance(self.pose, shown, dt)
        if self._limits is not None:
            self._keep_within(self._limits)
        if self.blend_problem == "turns over":
            self._extrapolate()
        first = tracks.playing[0]
        if (restarted := first.restarted()) is not None and tracks.alone:
            first.player.cue_anchor(first.motion.name, restarted)
            self._fade_to_first(self.motion)
        return completed

    def finish_tick(self) -> Pose:
        """Ends the tick; the pose in the world."""
        if self._body is not None:
            self._change_body(self._body)
        self._before, self.posture = self.posture, self._shown
        self._pose_before, self.pose = self.pose, self._next
        if self._limits is not None:
            self._limits.accept(self.pose)
            if not self.fading and not self.tracks.crossing:
                self._limits = None
        return self.pose

    def switch_to(self, motion: str, phase: float | None = None) -> None:
        """Starts a motion where it resembles the body most, or at a phase, and the join from what is shown to it."""
        # While another switch is under way, or motions are blended, the join is a fade.
        leaving, entering, joining = self.motion, self.motions[motion], self._joining
        anchor = self._best_anchor(motion, self.posture, self._shown) if phase is None else 0
        self._limit(leaving, entering)
        self._go_over_to(entering.offsets)
        if joining in ("morph", "crossfade") and phase is None and not self.fading and self.tracks.alone:
            self._mix_to(motion, anchor)
            return
        first = self._play_alone(self.tracks.playing[0])
        first.cue(motion, anchor) if phase is None else first.cue_phase(motion, phase)
        if joining == "cut":
            self._fade, self._limits, self._body_elapsed = None, None, MORPH_SECONDS
            self._switching = True  # completed in the next step
        else:
            self._fade_to_first(leaving, entering)

    def jump(self, phase: float) -> None:
        """Goes to a phase in [0, 1] of the motion that is played, and fades from what is shown to it."""
        motion = self.motion
        self._limit(motion)
        first = self._play_alone(self.tracks.playing[0])
        first.cue_phase(motion.name, phase)
        self._fade_to_first(motion)

    def blend_in(self, weights: Mapping[str, float]) -> None:
        """Goes over to a blend of weights with sum 1, MORPH_SECONDS for a change by 1; at most MOST_BLENDED play."""
        tracks = self.tracks
        for name in sorted(weights.keys() - {track.motion.name for track in tracks.playing}):
            tracks.add(name, self._best_anchor(name, self._before, self.posture), self._tempo)
        self._limit(*(track.motion for track in tracks.playing))
        tracks.change_weights(weights, MORPH_SECONDS)
        self._go_over_to(sum((weight * self.motions[name].offsets for name, weight in weights.items()), np.zeros(3)))

    @property
    def _onset(self) -> float:
        """The share of the tempo at which the motion plays: a one-shot starts slowly as it fades in."""
        return self._fade.onset if self._fade is not None and not self.motion.loop else 1.0

    def _faded(self, target: Posture) -> tuple[Posture, bool]:
        """What is shown in place of a target, and whether the last switch is completed with it."""
        if self._fade is not None:
            self._fade.advance(self._dt, float(target.turn_rate))
            if self._fade.lasts:
                return self._fade.shown(target), False
            self._fade = None
            return target, True
        if not self._switching or self.tracks.crossing or self.tracks.playing[0].morphing:
            return target, False
        self._play_alone(self.tracks.leading)
        return target, True

    def _keep_within(self, limits: JoinLimits) -> None:
        """Slows a change of weights, gives up a blend or replaces a join, as near as joints come to their limits."""
        tracks = self.tracks
        use = limits.use(self._next, self._dt, self._tempo)
        if tracks.crossing:
            wanted = min(max(1.0 - (use - EASED_FROM) / (EASED_TO - EASED_FROM), SLOWEST), 1.0)
            self._weight_pace += (wanted - self._weight_pace) * min(1.0, self._dt / EASING_SECONDS)
        # A fade whose duration is still being searched for has not had time to act.
        searching = self._fade is not None and not self._fade.found
        if tracks.blending:
            if use > BLEND_TURNS_OVER:
                self.blend_problem = "turns over"
        elif use > self._correct_from and not searching:
            self._correct_from = use + CORRECTED_AGAIN
            self._extrapolate()
            self._fade_instead()
        elif tracks.cannot_cross:
            self._fade_instead()

    def _go_over_to(self, offsets: Array) -> None:
        """Lets the bones go over to the length of another body's, in MORPH_SECONDS."""
        if offsets is self._body_goal or np.array_equal(offsets, self._body_goal):
            return
        rate = np.zeros(3) if self._body is None else self._body.leaving(self._body_elapsed)
        self._body_goal, self._body_elapsed = offsets, 0.0
        self._body = Fade(MORPH_SECONDS, MORPH_SECONDS, self._body_shown - offsets, rate)

    def _change_body(self, fade: Fade) -> None:
        self._body_elapsed += self._dt
        if self._body_elapsed < MORPH_SECONDS:
            self._body_shown = self._body_goal + fade.left(self._body_elapsed)
        else:
            self._body_shown, self._body = self._body_goal, None
        self._next.offsets = self._body_shown

    def _extrapolate(self) -> None:
        self._shown = extrapolated(self._before, self.posture, self._dt, self.tracks.rest_direction)
        self._next = advance(self.pose, self._shown, self._dt)

    def _limit(self, *motions: Motion) -> None:
        if self._limits is None:
            self._limits = JoinLimits(self._skeleton, self._pose_before, self.pose)
            self._weight_pace = 1.0
        self._limits.begin(*motions)
        self._correct_from = CORRECTED_FROM

    def _mix_to(self, motion: str, anchor: int) -> None:
        morphs = self._joining == "morph"
        if morphs and self._morphs_inside:
            self.tracks.playing[0].morph(motion, anchor, MORPH_SECONDS)
        elif morphs and self._by_module:
            self.tracks.morph_to(motion, anchor, self._dt, self._tempo)
        else:
            self.tracks.cross_to(motion, anchor, self._dt, self._tempo)
        self._switching = True

    def _play_alone(self, track: Track) -> Track:
        self.tracks.play_alone(track)
        self._switching = False
        return track

    def _fade_to_first(self, *motions: Motion) -> None:
        onset, first = 1.0 if self.motion.loop else 0.0, self.tracks.playing[0]
        self._take_first_steps(first, onset * self._tempo)
        self._begin_fade(first, onset, *motions)

    def _fade_instead(self) -> None:
        track, onset = self.tracks.leading, self._onset
        if self.tracks.alone and track.morphing:
            track.cue(track.motion.name, self._best_anchor(track.motion.name, self.posture, self._shown))
            self._take_first_steps(track, self._tempo)
        self._play_alone(track)
        self._begin_fade(track, onset, track.motion)

    def _take_first_steps(self, track: Track, tempo: float) -> None:
        """Steps a track that was just cued to its first two postures: a fade needs a rate of change."""
        track.step(0.0, tempo)
        track.step(self._dt, tempo)

    def _begin_fade(self, track: Track, onset: float, *motions: Motion) -> None:
        """Fades to the motion of a track, which gets going from the share `onset` of the tempo on."""
        shown, target = (self.posture, self._shown), (track.posture_before, track.posture)
        differ = partial(difference, shown, target, self._dt, self.tracks.rest_direction)
        bounds = Bounds.of(motions, FASTEST, 1.0).at(self._tempo)
        self._search = self._searches(differ, track.ahead(self._tempo, onset), self._skeleton.chain, bounds)
        self._fade = Fading(self._search, onset)

    def _best_anchor(self, motion: str, before: Posture, now: Posture) -> int:
        return int(self._entry_costs(motion, before, now, slice(None)).argmin())

    def _entry_costs(self, motion: str, before: Posture, now: Posture, anchors: NDArray[np.intp] | slice) -> Array:
        entering, place = self.motions[motion], self._joints(now)
        velocity = (place - self._joints(before)) / self._dt
        return entry_costs(place, velocity, entering.places[anchors], entering.velocities[anchors], VELOCITY_REACH)

    def _joints(self, posture: Posture) -> Array:
        """Joint positions relative to the root in the heading frame, and the root's height, shape (F,), m."""
        places = self._skeleton.joints(np.zeros(3), posture.rotation)
        return np.append(places[1:].ravel(), posture.height)


def at_origin(posture: Posture) -> Pose:
    """A posture that stands at the origin and faces along x."""
    return posture.at(np.array([0.0, 0.0, float(posture.height)]))


def advance(pose: Pose, posture: Posture, dt: float) -> Pose:
    """The posture in the world, after moving on from a pose with its velocities (x forward, y left) for dt seconds."""
    heading = float(pose.heading) + float(posture.turn_rate) * dt
    ahead, aside = posture.velocity.tolist()
    forward, left = ahead * dt, aside * dt
    x, y, _ = pose.root_position.tolist()
    if heading == 0.0:
        return posture.at(np.array([x + forward, y + left, float(posture.height)]), pose.offsets)
    cosine, sine = cos(heading), sin(heading)
    position = np.array([x + cosine * forward - sine * left, y + sine * forward + cosine * left, float(posture.height)])
    rotation = multiply(yaw(heading), posture.rotation)
    return Pose(position, np.array(heading), rotation, offsets=pose.offsets)
