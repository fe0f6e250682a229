"""Plays one motion, or a blend of several, and joins motions without a jump.

    track -> posture (or several of them -> blend) -> fade of the last switch -> limits of a join -> root path -> pose

It does what it is told at once; when a motion is played is decided by the deck.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from controller.deck.joins.blend_check import BlendCheck
from controller.deck.joins.blend_weight import Crossing, ModuleWeight, Ramps, TakeOver, Weights
from controller.deck.joins.crossing_search import CrossingSearch
from controller.deck.joins.deck_motions import Motion, read_motions, rounds_beside, tempos_in_step
from controller.deck.joins.fade_search import PLANNED_SHARE, Bounds, FadeSearch
from controller.deck.joins.fading import Fading
from controller.deck.joins.join_limits import FASTEST, HARDEST, JoinLimits
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
from controller.wire.messages.blends import MOST_BLENDED

# A difference in joint velocity counts as much as the distance it covers in this time (8 frames at 120 Hz), s.
VELOCITY_REACH = 8.0 / 120.0

# How long it takes to change the blend weight from 0 to 1, or a network from one motion to another, s.
MORPH_SECONDS = 1.0

# From which share of the limits of a join on it is replaced: halfway from what a fade means to use to all of them. One
# that uses no more than it means to is left alone: replaced while it speeds up, a body would swing farther still.
CORRECTED_FROM = 0.5 * (PLANNED_SHARE + 1.0)

# By how much more of the limits a join has to need to be replaced again: the fade that replaces it takes its time too.
CORRECTED_AGAIN = 0.05

# Between which shares of the limits a blend weight changes more and more slowly, how slowly at least, and how soon, s.
EASED_FROM, EASED_TO, SLOWEST, EASING_SECONDS = 0.7, 0.8, 0.2, 0.1

# While the weight of a blend changes, it is given up beyond so many times the limits of a join.
BLEND_TURNS_OVER = 2.0


class Performance:
    """Plays one motion of a library, or a blend of up to MOST_BLENDED.

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
        first = Track(library, self.motions)
        self._tracks = (first, *(Track(library, self.motions, first) for _ in range(MOST_BLENDED - 1)))
        # Those that play: in a blend several, in a switch by mixing the second is the one that is entered.
        self._played = [first]
        self._rounds = [1.0]  # how often each goes round in a common round of a blend
        self._blend: PostureBlend | None = None
        self._weights: Weights = Ramps((1.0,), (1.0,), 0.0)
        self._crossing: Crossing | None = None  # of a switch by mixing, the weight of the second
        self._weight_pace = 1.0  # of the weights, which change more slowly where joints become too fast
        self._switching = False  # whether a switch is under way that mixes or morphs
        self._check: BlendCheck | None = None
        self.blend_problem = ""
        self._fade: Fading | None = None
        self._limits: JoinLimits | None = None
        self._correct_from = CORRECTED_FROM
        self._dt, self._tempo = 1.0 / library.info.rate, 1.0
        first.cue_phase(motion, phase)
        first.step(0.0, 1.0)
        self._before = self.posture = self._shown = self._target = first.posture
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
        """Whether blend weights are still changing, or what they have led to is not yet one motion alone."""
        if self._blend is None or self._weights.changing:
            return self._blend is not None
        return self._blend.settling and 1.0 in self._weights.values

    @property
    def blend(self) -> tuple[tuple[str, float], ...]:
        """The motions that are blended into the one that is played, each with its present weight."""
        if self._blend is None or self._switching:
            return ()
        names = [track.motion.name for track in self._played]
        return tuple(zip(names[1:], self._weights.values[1:], strict=True))

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
        return self._tracks[0].inputs

    def set_input(self, name: str, value: float) -> None:
        """Gives an input of the network another value."""
        for track in self._tracks:
            track.set_input(name, value)

    def require_phase(self) -> None:
        """Checks that the network has a phase.

        Raises:
            MotiondeckError: if it runs by itself.
        """
        self._tracks[0].require_phase()

    @property
    def restarts(self) -> int:
        """How often the network lost its motion and was restarted."""
        return sum(track.restarts for track in self._tracks)

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
        elif not blending and use > self._correct_from and not self._searching:
            self._correct_from = use + CORRECTED_AGAIN
            self._take(extrapolated(self._before, self.posture, dt, self._rest_direction))
            self._fade_instead()
        elif self._crossing is not None and self._crossing.fails:
            self._fade_instead()
        if self.blend_problem == "turns over":
            self._take(extrapolated(self._before, self.posture, dt, self._rest_direction))
        first = self._played[0]
        restarted = first.restarted() if first.guarded else None
        if restarted is not None and self._blend is None:
            first.restart_at(restarted)
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

        While another switch is under way, or motions are blended, the join is a fade.
        """
        leaving, entering, joining = self.here, self.motions[motion], self._joining
        anchor = self._best_anchor(motion, self.posture, self._shown)
        self._limit(leaving, entering)
        if joining in ("morph", "crossfade") and not self.fading and self._blend is None:
            if joining == "morph" and self._morphs_inside:
                self._played[0].morph(motion, anchor, MORPH_SECONDS)
            else:
                self._mix_to(motion, anchor)
            self._switching = True
            return
        self._leave_blend(self._played[0])
        self._played[0].cue(motion, anchor)
        if joining == "cut":
            self._fade, self._limits = None, None
            self._switching = True  # completed in the next step
        else:
            self._fade_to_first(leaving, entering)

    def jump(self, phase: float) -> None:
        """Goes to a phase in [0, 1] of the motion that is played, and fades from what is shown to it."""
        motion = self.here
        self._limit(motion)
        self._leave_blend(self._played[0])
        self._played[0].cue_phase(motion.name, phase)
        self._fade_to_first(motion)

    def blend_in(self, weights: Mapping[str, float]) -> None:
        """Goes over to a blend, at MORPH_SECONDS for a weight that changes by 1.

        Args:
            weights: of its motions, which sum to 1; with those that play they are at most MOST_BLENDED.
        """
        if self._blend is None:
            self._blend = PostureBlend(self._played[0].posture, self._rest_direction)
            self._weights = Ramps((1.0,), (1.0,), 0.0)
        present = [*self._weights.values]
        playing = {track.motion.name for track in self._played}
        for name in sorted(weights.keys() - playing):
            self._add_to_blend(name)
            present.append(0.0)
        motions = [track.motion for track in self._played]
        if len(motions) > len(playing):
            self._check = BlendCheck(*motions)
        self._limit(*motions)
        goal = [weights.get(motion.name, 0.0) for motion in motions]
        change = max(abs(after - before) for after, before in zip(goal, present, strict=True))
        self._weights = Ramps(present, goal, change * MORPH_SECONDS)

    def finish_blend(self, first: str) -> None:
        """Drops the motions whose weight has become 0; where the one that leads is dropped, `first` leads."""
        values = self._weights.values
        left = [place for place, weight in enumerate(values) if weight != 0.0]
        if len(left) == len(values) or self._blend is None:
            return
        if 0 not in left:
            left.sort(key=lambda place: self._played[place].motion.name != first)
        if len(left) == 1:
            self._leave_blend(self._played[left[0]])
            return
        self._blend.keep(left)
        self._played = [self._played[place] for place in left]
        self._rounds = [self._rounds[place] for place in left]
        values = [values[place] for place in left]
        self._weights = Ramps(values, values, 0.0)
        self._check = BlendCheck(*(track.motion for track in self._played))

    @property
    def _searching(self) -> bool:
        """Whether the duration of a fade is still being searched for, so that it has not had time to act."""
        return self._fade is not None and not self._fade.found

    @property
    def _onset(self) -> float:
        """The share of the tempo at which the motion is played: one-shots get going as they are faded in."""
        return self._fade.onset if self._fade is not None and not self.here.loop else 1.0

    @property
    def _leading(self) -> Track:
        return self._played[-1] if self._switching else self._played[0]

    def _play(self, dt: float, tempo: float) -> Posture:
        """The posture of the motion, or of the blend, dt seconds later."""
        played = self._played
        if self._blend is None:
            return played[0].step(dt, tempo if self._fade is None else tempo * self._onset)
        weights: Sequence[float] = self._weights.advance(dt * self._weight_pace)
        tempos: Sequence[float] = [1.0] * len(played)
        if not self._switching:
            lasts = [rounds * track.motion.seconds for rounds, track in zip(self._rounds, played, strict=True)]
            tempos = tempos_in_step(lasts, weights)
        postures = [track.step(dt, tempo * own) for track, own in zip(played, tempos, strict=True)]
        return self._blend.advance(postures, weights, dt)

    def _faded(self, dt: float) -> tuple[Posture, bool]:
        """The target with what is left of the last switch, and whether the switch is now complete."""
        target = self._target
        if self._fade is not None:
            self._fade.advance(dt, float(target.turn_rate))
            if self._fade.lasts:
                return self._fade.shown(target), False
            self._fade = None
            return target, True
        if self.crossing or self._played[0].morphing:
            return target, False
        if self._blend is not None:
            self._leave_blend(self._leading)
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
        self._correct_from = CORRECTED_FROM

    def _mix_to(self, motion: str, anchor: int) -> None:
        """Enters a motion on a second track, and mixes both until it is left alone."""
        leaving, entering = self.here, self.motions[motion]
        by_module = self._by_module and self._joining == "morph"
        second = self._idle_track()
        second.cue(motion, anchor)
        if not by_module:
            second.step(0.0, self._tempo)  # for the search: what comes before
        now = second.step(self._dt, self._tempo)
        self._blend = PostureBlend(self._played[0].posture, self._rest_direction)
        self._blend.add(now)
        self._played.append(second)
        if by_module:
            weight = ModuleWeight(len(self._names), *map(self._names.index, (leaving.name, motion)))
        else:
            weight = self._crossing = Crossing(self._crossing_search(leaving, entering), self._blend.hold_sides)
        self._weights = TakeOver(weight)

    def _add_to_blend(self, name: str) -> None:
        """Starts a motion where it resembles the body most, beside those of the blend."""
        assert self._blend is not None
        track, motion = self._idle_track(), self.motions[name]
        track.cue(name, self._best_anchor(name, self._before, self.posture))
        track.step(0.0, self._tempo)
        # Beside the motion that leads: those that are blended already keep step as they did.
        self._rounds.append(self._rounds[0] * rounds_beside(self._played[0].motion, motion))
        self._played.append(track)
        self._blend.add(track.posture)

    def _idle_track(self) -> Track:
        return next(track for track in self._tracks if track not in self._played)

    def _leave_blend(self, track: Track) -> None:
        """Leaves one track playing alone."""
        self._played, self._rounds = [track], [1.0]
        self._blend, self._crossing, self._switching = None, None, False

    def _fade_to_first(self, *motions: Motion) -> None:
        """Fades from what is shown to the motion of the first track, which has just been cued."""
        onset, first = 1.0 if self.here.loop else 0.0, self._played[0]
        first.step(0.0, onset * self._tempo)
        first.step(self._dt, onset * self._tempo)
        self._begin_fade(first, onset, *motions)

    def _fade_instead(self) -> None:
        """Replaces a join that has become too fast by a fade from here to its target."""
        track, onset = self._leading, self._onset
        if self._blend is None and track.morphing:
            track.cue(track.motion.name, self._best_anchor(track.motion.name, self.posture, self._shown))
            track.step(0.0, self._tempo)
            track.step(self._dt, self._tempo)
        self._leave_blend(track)
        self._begin_fade(track, onset, track.motion)

    def _begin_fade(self, track: Track, onset: float, *motions: Motion) -> None:
        self._fade = Fading(self._search(track, onset, *motions), onset)

    def _search(self, track: Track, onset: float, *motions: Motion) -> FadeSearch:
        """Finds the fade from what is shown to the motion of a track, bounded by what these motions do themselves.

        The motion gets going from this share of the tempo on.
        """
        speed, acceleration = (max(getattr(motion, name) for motion in motions) for name in ("speed", "acceleration"))
        shown, target = (self.posture, self._shown), (track.posture_before, track.posture)
        return FadeSearch(
            partial(difference, shown, target, self._dt, self._rest_direction),
            track.ahead(self._tempo, onset),
            self._skeleton.chain,
            Bounds(FASTEST * speed, acceleration),
        )

    def _crossing_search(self, *motions: Motion) -> CrossingSearch:
        """Finds how long it takes to mix both motions, which play on their tracks."""
        speed, acceleration = (max(getattr(motion, name) for motion in motions) for name in ("speed", "acceleration"))
        share, tempo = PLANNED_SHARE * max(1.0, abs(self._tempo)), self._tempo

        def ahead(times: Array) -> tuple[Posture, Posture]:
            first, second = (track.postures_ahead(times, tempo) for track in self._played)
            return first, second

        return CrossingSearch(ahead, self._skeleton, Bounds(share * FASTEST * speed, share * HARDEST * acceleration))

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
