"""The playing tracks: one alone, a blend, or two of which the second takes over."""

from collections.abc import Mapping, Sequence

import numpy as np

from controller.deck.joins.blend_weight import Crossing, CrossingSearch, ModuleTakeOver, Ramps, Weights
from controller.deck.joins.deck_motions import SUMMED, Motion, rounds_beside, tempos_in_step
from controller.deck.joins.fade_search import PLANNED_SHARE
from controller.deck.joins.join_limits import FASTEST, HARDEST, Bounds
from controller.deck.joins.posture_blend import PostureBlend
from controller.deck.tracks.track import Track
from controller.library.motion_library import MotionLibrary
from controller.motion.rotations import Array
from controller.motion.skeleton import Posture
from controller.wire.messages.arguments import MOST_BLENDED

STILL, TURNS_OVER = 0.1, 2.5
HALF_A_SECOND = 0.5


class BlendCheck:
    """Checks a blend while it plays: it may stand still, or a bone that points opposite ways may turn over.

    The criteria are those of `benchmarks/deck/blends.py`: within half a second no joint moves a tenth as far as in the
    motion that moves least; or a joint moves two and a half times as fast as it ever does in any of them.
    """

    def __init__(self, *motions: Motion) -> None:
        self._least = STILL * min(float(np.ptp(motion.places, axis=0).max()) for motion in motions)
        self._fastest = TURNS_OVER * max(float(np.abs(motion.velocities).max()) for motion in motions)
        self._last: Array | None = None
        self._begin_window()

    def problem(self, places: Array, dt: float, tempo: float) -> str:
        """The problem of the blend: "stands still", "turns over", or "" for none.

        Joint positions are as `Motion.places` has them, shape (F,), m; the last call was dt seconds ago.
        """
        last, self._last = self._last, places
        # Weights change as fast in a pause, and below the tempo of 1, as at it.
        if last is not None and float(np.abs(places - last).max()) > self._fastest * dt * max(1.0, abs(tempo)):
            return "turns over"
        self._low, self._high = np.minimum(self._low, places), np.maximum(self._high, places)
        self._played += dt * abs(tempo)
        if self._played < HALF_A_SECOND - SUMMED:
            return ""
        still = float((self._high - self._low).max()) < self._least
        self._begin_window()
        return "stands still" if still else ""

    def _begin_window(self) -> None:
        self._low: Array = np.array(np.inf)
        self._high: Array = np.array(-np.inf)
        self._played = 0.0


class PlayingTracks:
    """The tracks of a library, one or up to MOST_BLENDED by weight; the first leads, unless another takes over."""

    def __init__(self, library: MotionLibrary, motions: Mapping[str, Motion]) -> None:
        self._motions, self._names = motions, library.network.motions
        self._skeleton = library.encoding.skeleton
        twist_by_rule = library.encoding.twist_by_rule
        # The directions of the bones in the rest pose, shape (B, 3), where their twist follows a rule.
        self.rest_direction = self._skeleton.rest_direction if twist_by_rule else None
        first = Track(library, motions)
        self.every = (first, *(Track(library, motions, first) for _ in range(MOST_BLENDED - 1)))
        self.play_alone(first)

    def play_alone(self, track: Track) -> None:
        """Leaves one track playing alone."""
        self.playing = [track]
        self._rounds = [1.0]  # how often each goes round in a common round of a blend
        self._weights: Weights = _constant((1.0,))
        self._blend: PostureBlend | None = None
        self._check: BlendCheck | None = None
        self._taking_over = False

    @property
    def leading(self) -> Track:
        """The track that plays alone, takes over, or has been in a blend longest."""
        return self.playing[-1] if self._taking_over else self.playing[0]

    @property
    def alone(self) -> bool:
        """Whether one track plays alone."""
        return self._blend is None

    @property
    def blending(self) -> bool:
        """Whether motions are blended, and none of them takes over."""
        return self._blend is not None and not self._taking_over

    @property
    def blend(self) -> tuple[tuple[str, float], ...]:
        """The motions that are blended into the one that leads, each with its present weight."""
        return tuple(self.weights.items())[1:] if self.blending else ()

    @property
    def weights(self) -> dict[str, float]:
        """The present weight of each motion that plays."""
        return {track.motion.name: weight for track, weight in zip(self.playing, self._weights.values, strict=True)}

    @property
    def crossing(self) -> bool:
        """Whether weights are still changing, or what they have led to is not yet one motion alone."""
        if self._blend is None or self._weights.changing:
            return self._blend is not None
        return self._blend.settling and 1.0 in self._weights.values

    @property
    def cannot_cross(self) -> bool:
        """Whether the motion that is to take over cannot be mixed with the first within the limits of a join."""
        return self._weights.fails

    def step(self, dt: float, tempo: float, pace: float) -> Posture:
        """Advances by dt seconds at a tempo, the weights at a pace of their own; the posture there."""
        if self._blend is None:
            return self.playing[0].step(dt, tempo)
        weights = self._weights.advance(dt * pace)
        tempos = (1.0,) * len(weights)
        if not self._taking_over:
            lasts = [rounds * track.motion.seconds for rounds, track in zip(self._rounds, self.playing, strict=True)]
            tempos = tempos_in_step(lasts, weights)
        postures = [track.step(dt, tempo * own) for track, own in zip(self.playing, tempos, strict=True)]
        return self._blend.advance(postures, weights, dt)

    def set_input(self, name: str, value: float) -> None:
        """Changes an input of all tracks."""
        for track in self.every:
            track.player.set_input(name, value)

    def problem(self, places: Array, dt: float, tempo: float) -> str:
        """The problem of a blend that is shown with joints at these places, or ""; see `BlendCheck.problem`."""
        return self._check.problem(places, dt, tempo) if self._check is not None else ""

    def morph_to(self, motion: str, anchor: int, dt: float, tempo: float) -> None:
        """Starts a motion that takes over as the switching module of the network goes from one to the other."""
        ends = (self._names.index(name) for name in (self.leading.motion.name, motion))
        self._start_take_over(motion, anchor, dt, tempo)
        self._weights = ModuleTakeOver(len(self._names), *ends)

    def cross_to(self, motion: str, anchor: int, dt: float, tempo: float) -> None:
        """Starts a motion that takes over within the limits of a join; see `CrossingSearch`."""
        blend = self._start_take_over(motion, anchor, dt, tempo)
        share = PLANNED_SHARE * max(1.0, abs(tempo))
        motions = [track.motion for track in self.playing]

        def ahead(times: Array) -> tuple[Posture, Posture]:
            first, second = (track.postures_ahead(times, tempo) for track in self.playing)
            return first, second

        bounds = Bounds.of(motions, share * FASTEST, share * HARDEST)
        self._weights = Crossing(CrossingSearch(ahead, self._skeleton, bounds), blend.hold_sides)

    def _start_take_over(self, motion: str, anchor: int, dt: float, tempo: float) -> PostureBlend:
        """Enters a motion on a second track, which leads from now on; the blend of both."""
        second = self._idle()
        second.cue(motion, anchor)
        blend = self._blend = PostureBlend(self.playing[0].posture, self.rest_direction)
        blend.add(second.step(dt, tempo))
        self.playing.append(second)
        self._taking_over = True
        return blend

    def add(self, motion: str, anchor: int, tempo: float) -> None:
        """Starts a motion beside those that play, in step with them, with a weight of 0 so far."""
        first, track = self.playing[0], self._idle()
        track.cue(motion, anchor)
        if self._blend is None:
            self._blend = PostureBlend(first.posture, self.rest_direction)
        self._blend.add(track.step(0.0, tempo))
        # Beside the motion that leads: those that are blended already keep step as they did.
        self._rounds.append(self._rounds[0] * rounds_beside(first.motion, self._motions[motion]))
        self.playing.append(track)
        self._weights = _constant((*self._weights.values, 0.0))
        self._check = None

    def change_weights(self, goal: Mapping[str, float], seconds: float) -> None:
        """Has the playing motions' weights change to these, of sum 1, others to 0; a change by 1 takes `seconds`."""
        motions = [track.motion for track in self.playing]
        present, goals = self._weights.values, [goal.get(motion.name, 0.0) for motion in motions]
        change = max(abs(after - before) for after, before in zip(goals, present, strict=True))
        self._weights = Ramps(present, goals, change * seconds)
        self._check = self._check or BlendCheck(*motions)

    def drop_weightless(self, lead: str) -> None:
        """Drops the motions whose weight has become 0; where the one that leads is dropped, `lead` leads."""
        values = self._weights.values
        left = [place for place, weight in enumerate(values) if weight != 0.0]
        if len(left) == len(values) or self._blend is None:
            return
        if 0 not in left:
            left.sort(key=lambda place: self.playing[place].motion.name != lead)
        if len(left) == 1:
            self.play_alone(self.playing[left[0]])
            return
        self._blend.keep(left)
        self.playing = [self.playing[place] for place in left]
        self._rounds = [self._rounds[place] for place in left]
        self._weights = _constant([values[place] for place in left])
        self._check = BlendCheck(*(track.motion for track in self.playing))

    def _idle(self) -> Track:
        return next(track for track in self.every if track not in self.playing)


def _constant(weights: Sequence[float]) -> Ramps:
    return Ramps(weights, weights, 0.0)
