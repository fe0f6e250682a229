"""A clip as one picture: stick figures through the motion, then its heights, its speed and its gaps over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from controller.motion.anatomy import SIDES, anatomy
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.rotations import rotate
from motiondeck.pictures.figures import new_figure, save

if TYPE_CHECKING:
    from controller.motion.clip import Clip
    from controller.motion.formats.reading import FittedClip

FIGURES = 10
COLOUR = {"left": "#e0803c", "right": "#3f7fb5", "middle": "#39414d"}


def plot_clip(recording: FittedClip, out: Path) -> None:
    """Draws a recording into a picture; MotiondeckError if matplotlib is missing or the picture cannot be written."""
    clip = recording.clip
    figure = new_figure(12.0, 8.0)
    if clip.skeleton.is_rig:
        angles, speeds = figure.subplots(2, 1, sharex=True)
        time, shown = np.arange(len(clip)) / clip.rate, np.degrees(angles_of(clip.rotation[:, 1:]))
        for joint, course in zip(clip.skeleton.bones, shown.T, strict=True):
            angles.plot(time, course, label=joint)
            speeds.plot(time, np.gradient(course, 1.0 / clip.rate) if len(clip) > 1 else 0.0 * time)
        angles.set(ylabel="angle, deg", title=f"{clip.name} ({clip.source})")
        angles.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
        speeds.set(ylabel="speed, deg/s", xlabel="s")
        save(figure, out)
        return
    heights = [2.2, 1.0, 1.0] + ([0.8] if (fit := recording.fit) is not None else [])
    rows = figure.subplots(len(heights), 1, height_ratios=heights)
    _figures(rows[0], clip)
    _curves(rows[1], rows[2], clip)
    if fit is not None:  # the residuals of markers on the fitted body, and the number of missing markers
        time, off = np.arange(len(fit.residual)) / fit.clip.rate, 1000.0 * fit.residual
        seen = ~np.isnan(off)
        mean = np.sqrt(np.where(seen, off, 0.0) ** 2 @ np.ones(off.shape[1]) / np.maximum(seen.sum(axis=1), 1))
        rows[3].plot(time, mean, color=COLOUR["middle"], label="markers off, mm rms")
        rows[3].plot(time, (~seen).sum(axis=1), color="#c0392b", label="markers not seen")
        rows[3].legend(loc="upper right", fontsize=8)
    for lower in rows[2:]:
        lower.sharex(rows[1])
    rows[-1].set_xlabel("s")
    save(figure, out)


def plot_sheet(clips: Sequence[Clip], out: Path) -> None:
    """Draws one row a clip: its mannequin at moments spread over it."""
    from motiondeck.pictures.clip_scene import act_of
    from motiondeck.pictures.video import FRAMES_A_ROW, contact_sheet

    rows = []
    for clip in clips:
        act = act_of(clip, None, ghost=False)
        moments = np.linspace(0, len(clip) - 1, FRAMES_A_ROW).astype(int)
        rows.append((clip.name.replace("_", " "), act.model, list(act.qpos[moments])))
    contact_sheet(rows, out)


def _figures(axes: Any, clip: Clip) -> None:
    """Stick figures side by side, each seen from the left and ahead of where the pelvis faces."""
    parts = anatomy(clip.skeleton)
    joints = clip.joints()
    frames = np.linspace(0, len(clip) - 1, FIGURES).astype(int)
    apart = 1.15 * max(float(np.ptp(joints[..., 2])), 0.5)
    for place, frame in enumerate(frames):
        ahead = rotate(clip.rotation[frame, 0], np.array([1.0, 0.0, 0.0]))
        angle = np.arctan2(ahead[1], ahead[0]) + np.radians(50.0)
        x, y, up = (joints[frame] - joints[frame, 0] * [1.0, 1.0, 0.0]).T
        across = y * np.cos(angle) - x * np.sin(angle)
        for bone, parent in enumerate(clip.skeleton.parent + 1):
            ends = [parent, 1 + bone]
            axes.plot(across[ends] + place * apart, up[ends], color=COLOUR[parts.side[bone]], linewidth=2.0)
        axes.text(place * apart, -0.08 * apart, f"{frame / clip.rate:.2f} s", ha="center", va="top", fontsize=8)
    axes.axhline(0.0, color="0.8", linewidth=0.8)
    axes.set_title(f"{clip.name} ({clip.source}): left orange, right blue")
    axes.set_aspect("equal")
    axes.set_axis_off()


def _curves(heights: Any, speeds: Any, clip: Clip) -> None:
    parts = anatomy(clip.skeleton)
    joints = clip.joints()
    time = np.arange(len(clip)) / clip.rate
    head = parts.first("head")
    heights.plot(time, joints[:, 0, 2], color=COLOUR["middle"], label="root")
    if head is not None:
        heights.plot(time, joints[:, 1 + head, 2], color="0.6", label="head")
    for side in SIDES:
        for bones, part, style in ((parts.all("foot", side), "foot", "-"), (parts.all("hand", side), "hand", ":")):
            if bones:
                lowest = joints[:, 1 + np.array(bones), 2].min(axis=1)
                heights.plot(time, lowest, style, color=COLOUR[side], label=f"{side} {part}")
    heights.set(ylabel="height, m")
    heights.legend(loc="upper right", ncols=6, fontsize=8)
    if len(clip) > 1:
        speed = np.linalg.norm(np.diff(joints, axis=0), axis=-1) * clip.rate
        speeds.plot(time[1:], speed[:, 0], color=COLOUR["middle"], label="root")
        speeds.plot(time[1:], speed.max(axis=1), color="0.6", label="fastest joint")
        speeds.legend(loc="upper right", fontsize=8)
    speeds.set(ylabel="speed, m/s")


def draw_segments(clip: Clip, report: dict[str, Any], path: Path) -> None:
    """Heights of hands, feet and head of a recording over time, and the cuts through them."""
    figure = new_figure(11, 3.6)
    axes = figure.add_subplot()
    time = np.arange(len(clip)) / clip.rate
    for bone, height in zip(("root", *clip.skeleton.bones), clip.joints()[:, :, 2].T, strict=True):
        if bone.endswith(("hand", "wrist", "foot", "head", "root")):
            axes.plot(time, height, linewidth=0.8, label=bone)
    for index, one in enumerate(report["segments"]):
        if index:
            axes.axvline(one["from_s"], color="black", linewidth=1.4, label="cut" if index == 1 else None)
        name, middle = one["motion"] or str(index + 1), 0.5 * (one["from_s"] + one["to_s"])
        axes.annotate(name, (middle, 1.01), xycoords=("data", "axes fraction"), ha="center")
    axes.set(xlabel="s", ylabel="height, m", xlim=(0.0, time[-1]))
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    save(figure, path)
