"""Statistics of a clip: its body, rate, extent and speed, and the gaps of its markers."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from controller.learning.recording_analysis import decided
from controller.motion.anatomy import SIDES, Part, anatomy
from controller.motion.canonical.body_doubts import doubts, recorded_parts
from controller.motion.clip import Clip, Decision, runs
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.formats.markers.marker_fit import Fit, misplaced
from controller.motion.formats.reading import FittedClip
from motiondeck_base.errors import FileFormatError

LIMBS: tuple[Part, ...] = ("thigh", "shank", "foot", "upper arm", "forearm", "hand")


def joint_facts(clip: Clip) -> dict[str, Any]:
    """The statistics of a clip of a rig's joints: s, Hz; for each joint its range, rad, and largest speed, rad/s."""
    angles = angles_of(clip.rotation[:, 1:])
    speed = np.abs(np.diff(angles, axis=0, append=angles[-1:])).max(axis=0) * clip.rate
    columns = np.stack([angles.min(axis=0), angles.max(axis=0), speed], axis=1).tolist()
    joints = [dict(zip(("lower", "upper", "speed"), row, strict=True)) for row in columns]
    known = {"name": clip.name, "source": clip.source, "plays": clip.plays, "frames": len(clip), "rate": clip.rate}
    return known | {"duration": clip.duration, "joints": dict(zip(clip.skeleton.bones, joints, strict=True))}


def facts(recording: FittedClip) -> dict[str, Any]:
    """The statistics of a recording: m, s, Hz, m/s; extents and heights are lowest and highest."""
    clip = recording.clip
    joints = clip.joints()
    extents = np.stack([joints.min(axis=(0, 1)), joints.max(axis=(0, 1))], axis=1).tolist()
    step = np.linalg.norm(np.diff(clip.root_position[:, :2], axis=0), axis=-1)
    speed = np.linalg.norm(np.diff(joints, axis=0), axis=-1) * clip.rate
    fastest = int(speed.max(axis=0).argmax()) if len(clip) > 1 else 0
    parts = anatomy(clip.skeleton)
    human = all(parts.first("thigh", side) is not None for side in SIDES)
    missing = [f"{side} {part}" for part in LIMBS for side in SIDES if parts.first(part, side) is None]
    decisions, doubtful = decided_of(recording)
    return {
        "name": clip.name,
        "source": clip.source,
        "skeleton": clip.skeleton.name,
        "bones": len(clip.skeleton),
        "lacks": missing + ([] if parts.first("head") is not None else ["head"]),
        "taken_for": recorded_parts(clip) if human else {},
        "doubts": doubtful,
        "decisions": [asdict(decision) for decision in decisions],
        "leg": clip.skeleton.leg_length,
        "frames": len(clip),
        "rate": clip.rate,
        "duration": clip.duration,
        **dict(zip("xyz", extents, strict=True)),
        "root_height": [float(clip.root_position[:, 2].min()), float(clip.root_position[:, 2].max())],
        "path": float(step.sum()),
        "median_speed": float(np.median(step) * clip.rate) if len(step) else 0.0,
        "fastest_joint": ("root", *clip.skeleton.bones)[fastest],
        "fastest_speed": float(speed.max()) if len(clip) > 1 else 0.0,
        "gaps": None if recording.fit is None else gaps(recording.fit),
    }


def decided_of(recording: FittedClip) -> tuple[list[Decision], list[str]]:
    """What `motiondeck learn` decides about a recording, and its doubts.

    Only those of reading and of the body, where nothing could be learned.
    """
    try:
        motions = decided(recording, Path(recording.clip.source))
    except FileFormatError:
        misfits = [] if recording.fit is None else misplaced(recording.fit)
        return list(recording.clip.decisions), [*doubts(recording.clip), *misfits]
    decisions = [*motions[0].decisions[:-1], *(motion.decisions[-1] for motion in motions)]
    return decisions, list(dict.fromkeys(doubt for motion in motions for doubt in motion.doubts))


def gaps(fit: Fit) -> dict[str, Any]:
    """The gaps of the markers of a fit (share, frames) and their residuals (mm)."""
    unseen = np.isnan(fit.residual)
    longest = [max((end - first for first, end in runs(one)), default=0) for one in unseen.T]
    worst = int(np.argmax(longest))
    off = 1000.0 * fit.residual[~unseen]
    return {
        "markers": len(fit.markers),
        "seen": float(1.0 - unseen.mean()),
        "longest_gap": longest[worst],
        "longest_gap_marker": fit.markers[worst] if longest[worst] else "",
        "residual_rms_mm": float(np.sqrt(np.mean(off**2))),
        "residual_p95_mm": float(np.percentile(off, 95.0)),
        "residual_max_mm": float(off.max()),
    }
