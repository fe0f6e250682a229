"""The clip that a recorded tree of joints makes, whatever file it came from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from controller.motion.clip import Clip
from controller.motion.joint_tree import JointTree, body_of
from controller.motion.reading_options import ReadingOptions
from controller.motion.rest_pose import stand
from controller.motion.rotations import continuous
from controller.motion.up_axis import Up


def clip_of(
    tree: JointTree,
    rate: float,
    path: str | Path,
    options: ReadingOptions,
    *,
    unit: float | None = None,
    up: Up | None = None,
) -> Clip:
    """The clip of a tree of joints.

    Args:
        tree: the joints, in the axes and the unit of the file.
        rate: frames per second, Hz.
        path: of the file; its name is the clip's.
        options: what overrules the file.
        unit: what the file or its format says that one of its lengths is, m; None finds out.
        up: the axis that the file or its format says is up; None finds out.

    Raises:
        FileFormatError: naming the file, if no body has such joints.
    """
    name = Path(path).stem
    tree = replace(tree, names=options.renamed(tree.names, path))
    skeleton, position, rotation = stand(name, body_of(tree, path), options.unit or unit, options.up or up)
    return Clip(name, skeleton, rate, position, continuous(rotation), Path(path).name)
