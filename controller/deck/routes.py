"""Routes: the motions in between where one motion is too far from another (crawl, standup, waltz).

The leap from one motion to another is how far the heights of the joints are apart when one is left and the other is
entered where it resembles the body most: root mean square over the joints, median over the places where the first may
be left. Arms and legs may swing as far as they like; lying, sitting and standing are what cannot be joined. A way costs

    sum over its legs of  (leap / LEAP_M)^2 + 1

and the cheapest one is taken. Only one-shots lie on a way: they lead from one posture to another.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from controller.deck.joins.deck_motions import Motion, read_motions
from controller.library.motion_library import MotionLibrary, once_a_library
from controller.motion.rotations import Array
from motiondeck_base.arrays_on_disk import release

LEAP_M = 0.2  # a leap that is worth one more motion on the way, m


@dataclass(frozen=True)
class Routes:
    """The graph of the motions of a library."""

    leaps: Mapping[str, Mapping[str, float]]  # from each motion to each other one, m
    bridges: frozenset[str]  # the motions that may lie on a way

    @classmethod
    def between(cls, motions: Mapping[str, Motion]) -> Routes:
        """The routes between motions."""
        leaps: dict[str, dict[str, float]] = {}
        for name, leaving in motions.items():
            leaps[name] = {other: leap(leaving, entering) for other, entering in motions.items()}
            release()
        return cls(leaps, frozenset(name for name, motion in motions.items() if not motion.loop))

    @staticmethod
    @once_a_library
    def of(library: MotionLibrary) -> Routes:
        """The routes between the motions of a library; baked motions go the ways of those that they are made from."""
        motions, baked = read_motions(library), library.info.baked
        routes = Routes.between(motions)
        return replace(routes, leaps=baked.leaps) if baked is not None else routes

    @property
    def direct(self) -> Routes:
        """The same motions where no leap is too far, so that every way is direct."""
        return Routes({name: dict.fromkeys(others, 0.0) for name, others in self.leaps.items()}, self.bridges)

    def way(self, start: str, goal: str) -> tuple[str, ...]:
        """The motions on the cheapest way from one motion to another, both left out; empty where it is direct."""
        if (cheapest := (self.leaps[start][goal] / LEAP_M) ** 2 + 1.0) < 2.0:
            return ()  # any other way has two legs
        ways: list[tuple[float, str, tuple[str, ...]]] = [(0.0, start, ())]
        closed: set[str] = set()
        while True:
            cost, here, way = heapq.heappop(ways)
            if here == goal and way:
                return way[:-1]
            if here in closed or cost + 1.0 > cheapest:
                continue
            closed.add(here)
            for following, leap_m in self.leaps[here].items():
                total = cost + (leap_m / LEAP_M) ** 2 + 1.0
                # From a bridge at least one motion more is needed.
                bridge = following in self.bridges and following not in closed and total + 1.0 <= cheapest
                if following == goal or bridge:
                    heapq.heappush(ways, (total, following, (*way, following)))
                    cheapest = min(cheapest, total) if following == goal else cheapest

    def between_blended(self, one: str, other: str) -> str:
        """The first motion that lies between two others, in either direction; "" if they can play side by side."""
        return next((via[0] for way in ((one, other), (other, one)) if (via := self.way(*way))), "")

    def blend_obstacle(self, motions: Sequence[str]) -> str:
        """Why the first of some motions, which is entered first, cannot be blended with the others; "" if it can be."""
        for name in motions:
            if name in self.bridges:
                return f"{name} is a one-shot; only loops can be blended"
        for one, other in combinations(motions, 2):
            # The first one plays already when the others are blended in.
            via = next(iter(self.way(one, other)), "") if one == motions[0] else self.between_blended(one, other)
            if via:
                return f"{one} and {other} are too far apart to be blended: {via} lies between them"
        return ""


def leap(leaving: Motion, entering: Motion) -> float:
    """How far the heights of the joints are apart at a switch, m; 0 from a loop to itself."""
    squares = np.square(leaving.exits).sum(1)[:, None] + np.square(entering.places).sum(1)
    nearest = (squares - 2.0 * leaving.exits @ entering.places.T).argmin(1)
    apart = _heights(leaving.exits) - _heights(entering.places[nearest])
    return float(np.median(np.sqrt(np.square(apart).mean(1))))


def _heights(places: Array) -> Array:
    """The heights of root and joints above the ground, shape (A, 1 + joints), m."""
    root = places[:, -1:]
    return np.concatenate([root, root + places[:, 2:-1:3]], axis=1)
