"""The encodings: bone directions or joint rotations for bodies, joint angles for rigs, joints and root if baked.

ENCODINGS lists them by the name that libraries use. A further one is a class of the same methods, and an entry here.
"""

from controller.motion.encodings.bone_directions import BoneDirections, JointRotations
from controller.motion.encodings.joint_angles import JointAngles, JointBody
from controller.motion.encodings.robot_joints import RobotJoints
from controller.motion.skeleton import Skeleton

Encoding = BoneDirections | JointAngles

_KINDS: tuple[type[Encoding], ...] = (BoneDirections, JointRotations, JointAngles, RobotJoints)
ENCODINGS = {kind.name: kind for kind in _KINDS}


def encoding_of(skeleton: Skeleton, *, twist: bool = False) -> Encoding:
    """The encoding for clips of a skeleton, with twists if `twist` (FileFormatError for a body without hips)."""
    if isinstance(skeleton, JointBody):
        return JointAngles(skeleton)
    return JointRotations.of(skeleton) if twist else BoneDirections.of(skeleton)
