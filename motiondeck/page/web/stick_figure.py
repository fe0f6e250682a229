"""Small stick figures, and curves of joints, as SVG for thumbnails and film strips."""

from collections.abc import Sequence

import numpy as np

from controller.motion.rotations import Array

TURN = np.radians(35.0)  # from the side towards the front
INK, PALE = "#1c4f8c", "#a9bdd6"


def figure_svg(poses: Array, parents: Sequence[int]) -> str:
    """The last of some poses drawn dark, those before it pale, as one square picture.

    Poses are positions of the joints, the root first, shape (P, 1 + B, 3), m. Parents of bones are -1 for the root;
    bone b ends at joint 1 + b.
    """
    across = poses[..., 0] * np.cos(TURN) + poses[..., 1] * np.sin(TURN)
    flat = np.stack([across, -poses[..., 2]], axis=-1)
    low, high = flat.min(axis=(0, 1)), flat.max(axis=(0, 1))
    scale = 0.88 / max(float((high - low).max()), 1e-6)
    flat = 100.0 * (0.5 + scale * (flat - 0.5 * (low + high)))
    starts, paths = np.asarray(parents) + 1, ""
    for place, pose in enumerate(flat, 1):
        bones = np.hstack([pose[starts], pose[1:]])
        stroke = "".join("M{:.0f} {:.0f}L{:.0f} {:.0f}".format(*bone) for bone in bones)
        paths += f'<path d="{stroke}" stroke="{INK if place == len(flat) else PALE}"/>'
    return (
        '<svg viewBox="0 0 100 100" width="64" height="64" fill="none" stroke-width="5" '
        f'stroke-linecap="round" aria-hidden="true">{paths}</svg>'
    )


def curves_svg(angles: Array) -> str:
    """How joints turned, as one wide picture of their angles, shape (J, T), rad; those that hardly move are pale."""
    low, high = float(angles.min()), float(angles.max())
    across = np.linspace(0.0, 300.0, angles.shape[1])
    down = 2.0 + 56.0 * (high - angles) / max(high - low, 1e-6)
    moved = np.ptp(angles, axis=1)
    paths = "".join(
        f'<path stroke="{INK if much > 0.25 * moved.max() else PALE}" d="M'
        + "L".join(f"{x:.0f} {y:.1f}" for x, y in zip(across, row, strict=True))
        + '"/>'
        for row, much in zip(down, moved, strict=True)
    )
    return f'<svg viewBox="0 0 300 60" preserveAspectRatio="none" fill="none" stroke-width="1.5">{paths}</svg>'
