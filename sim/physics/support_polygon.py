"""Support polygon of a standing body, and the margin of a point inside it."""

import numpy as np

from controller.motion.rotations import Array


def convex_hull(points: Array) -> Array:
    """The corners (K, 2) of the convex hull of points (N, 2), anticlockwise; fewer than three if they lie on a line."""
    ordered = sorted(map(tuple, np.asarray(points, dtype=np.float64).tolist()))

    def chain(way: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
        kept: list[tuple[float, ...]] = []
        for point in way:
            while len(kept) > 1 and _turn(kept[-2], kept[-1], point) <= 0.0:
                kept.pop()
            kept.append(point)
        return kept[:-1]

    corners = chain(ordered) + chain(ordered[::-1])
    return np.array(corners or ordered[:1], dtype=np.float64).reshape(-1, 2)


def margin(polygon: Array, point: Array) -> float:
    """How far inside a convex polygon (K, 2), anticlockwise, a point (2,) lies, m; outside it is minus the distance."""
    if len(polygon) == 0:
        return -np.inf
    edge = np.roll(polygon, -1, axis=0) - polygon
    length = np.maximum(np.hypot(edge[:, 0], edge[:, 1]), 1e-12)
    away = point - polygon
    if len(polygon) > 2:
        inside = (edge[:, 0] * away[:, 1] - edge[:, 1] * away[:, 0]) / length
        if inside.min() >= 0.0:
            return float(inside.min())
    share = np.clip((away * edge).sum(axis=1) / length**2, 0.0, 1.0)
    nearest = away - share[:, None] * edge
    return -float(np.hypot(nearest[:, 0], nearest[:, 1]).min())


def _turn(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
