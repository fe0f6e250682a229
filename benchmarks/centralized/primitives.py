"""How near movement primitives come to recordings that were held out.

Hands and feet relative to the hips, mm, of several recordings of one motion in a folder. Each recording is held out
once; what is known of it is nothing, its end, or its end and its middle. The error is the mean distance of hands and
feet over all of it; "within 2 sd" is the share of its values within two standard deviations of the mean (95 % would be
right). ProMP is that of movement_primitives, where it is installed, with as many weights; `bent` is the demonstration
whose known points are nearest, with a line (or two) added that leads through them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from threadpoolctl import threadpool_limits

from benchmarks import command
from benchmarks.papers.vakulenko import hands_and_feet
from controller.learning.centralized.motion_training import learn_primitive
from controller.motion.clip import ReadingOptions
from controller.motion.formats.acclaim.amc import skeleton_of
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import Array

FRAMES = 100
SATELLITES = 15
KNOWN = {"nothing": (), "end": (1.0,), "end and middle": (1.0, 0.5)}
PHASE = np.linspace(0.0, 1.0, FRAMES + 1)


def hands(path: Path) -> Array:
    """Hands and feet relative to the root and its heading at the beginning, mm, shape (K, 12)."""
    clip = read_clip(path, ReadingOptions(skeleton_of(path, path.parent.parent)))
    joints = clip.joints()
    which = [1 + bone for bone in hands_and_feet(clip.skeleton)]
    across = np.diff(joints[0][[which[0], which[1]]], axis=0)[0, :2]
    angle = np.arctan2(across[0], -across[1])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    relative = 1e3 * (joints[:, which] - joints[:, :1])
    return (relative @ turn).reshape(len(joints), -1)


def even(motion: Array) -> Array:
    """A motion at the phases that are compared."""
    own = np.linspace(0.0, 1.0, len(motion))
    return np.stack([np.interp(PHASE, own, column) for column in motion.T], axis=-1)


def bent(others: list[Array], held: Array, known: tuple[float, ...]) -> Array:
    """The nearest demonstration, led through what is known by straight lines; the mean where nothing is known."""
    each = np.stack([even(other) for other in others])
    if not known:
        return each.mean(0)
    at = [round(phase * FRAMES) for phase in sorted(known)]
    nearest = each[int(np.square(each[:, at] - held[at]).sum((1, 2)).argmin())]
    off = np.concatenate([np.zeros((1, held.shape[1])), held[at] - nearest[at]])
    corners = np.concatenate([[0.0], sorted(known)])
    return nearest + np.stack([np.interp(PHASE, corners, column) for column in off.T], axis=-1)


def probabilistic(others: list[Array], held: Array, known: tuple[float, ...]) -> Array:
    from movement_primitives.promp import ProMP  # pyright: ignore[reportMissingImports]

    primitive = ProMP(held.shape[1], n_weights_per_dim=SATELLITES)
    primitive.imitate([PHASE] * len(others), [even(other) for other in others], n_iter=20)
    for phase in known:
        primitive = primitive.condition_position(held[round(phase * FRAMES)], t=phase, t_max=1.0)
    return primitive.mean_trajectory(PHASE)


def distance(found: Array, held: Array) -> float:
    return float(np.linalg.norm((found - held).reshape(len(held), -1, 3), axis=-1).mean())


def main(
    folders: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help="Recordings (.amc) of one motion each.")],
) -> None:
    try:
        import movement_primitives  # noqa: F401  # pyright: ignore[reportMissingImports]

        peer = True
    except ImportError:
        print("movement_primitives is not installed: ProMP is left out\n")
        peer = False
    print("| motion | recordings | known | primitive | within 2 sd | ProMP | bent |\n" + "|---" * 7 + "|")
    for folder in folders:
        shown = [hands(path) for path in sorted(folder.iterdir()) if path.suffix.lower() == ".amc"]
        rows: dict[str, list[list[float]]] = {name: [] for name in KNOWN}
        with threadpool_limits(1):
            for index, one in enumerate(shown):
                held, others = even(one), shown[:index] + shown[index + 1 :]
                primitive = learn_primitive(others, 120.0, satellites=SATELLITES)
                for name, known in KNOWN.items():
                    led = primitive
                    for phase in known:
                        led = led.through(phase, held[round(phase * FRAMES)])
                    mean, spread = led.mean(PHASE), led.spread(PHASE)
                    inside = float((np.abs(held - mean) <= 2.0 * spread + 1e-3).mean())
                    rival = distance(probabilistic(others, held, known), held) if peer else np.nan
                    rows[name].append([distance(mean, held), inside, rival, distance(bent(others, held, known), held)])
        for name, values in rows.items():
            ours, inside, rival, line = np.mean(values, axis=0)
            cells = f"{ours:.0f} | {100 * inside:.0f} % | {rival:.0f} | {line:.0f}"
            print(f"| {folder.name} | {len(shown)} | {name} | {cells} |", flush=True)


if __name__ == "__main__":
    command.run("primitives", main, __doc__)
