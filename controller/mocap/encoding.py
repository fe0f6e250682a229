"""Encodings: what the channels of a network mean. Bone directions for bodies, joint angles for taught rigs."""

from __future__ import annotations

from controller.mocap.bone_directions import BoneDirections
from controller.mocap.joint_angles import JointAngles, JointBody
from controller.mocap.skeleton import Skeleton

Encoding = BoneDirections | JointAngles


def encoding_of(skeleton: Skeleton) -> Encoding:
    """The encoding for clips of this skeleton.

    Raises:
        FileFormatError: if it is a body whose hips bear unusual names.
    """
    return JointAngles(skeleton) if isinstance(skeleton, JointBody) else BoneDirections.of(skeleton)
