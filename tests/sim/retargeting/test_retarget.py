from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from controller.motion.rotations import between, conjugate, from_rotation_vector, multiply, rotate
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import FileFormatError
from sim.retargeting.arm_angles import FOREARM
from sim.retargeting.human_limbs import LIMBS, LimbView
from sim.retargeting.retarget import (
    GAIN,
    SERVO_HUMANOID_JOINTS,
    SETTLE,
    LimbAngles,
    MannequinRetargeter,
    ServoHumanoidRetargeter,
)
from sim.retargeting.robot_limbs import limb_directions
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, bent_pose, human, random_pose, smooth_poses

pytestmark = pytest.mark.smoke

QUARTER = np.pi / 2.0


@pytest.fixture(scope="module")
def servo20():
    return load_robot(ROBOTS / "servo20.toml", human())


def angles(servo20, pose):
    servo20.retarget.reset()
    return dict(zip(servo20.joints, servo20.retarget(pose), strict=True))


@given(st.integers(0, 2**32 - 1))
def test_the_mannequin_turns_each_bone_as_its_parent_sees_it(seed):
    body = human()
    pose = random_pose(body, np.random.default_rng(seed))
    targets = MannequinRetargeter(body)(pose).reshape(-1, 3)
    seen = multiply(conjugate(pose.rotation[body.parent + 1]), pose.rotation[1:])
    assert np.allclose(np.abs(np.sum(from_rotation_vector(targets) * seen, axis=-1)), 1.0)


def test_a_mannequins_joint_turns_past_half_a_turn_without_a_jump_and_is_not_wound_up_for_good():
    body = human()
    retarget = MannequinRetargeter(body)
    path = [retarget(bent_pose(body, relb=(0.0, turn, 0.1))).copy() for turn in np.linspace(0.0, 1.28 * np.pi, 200)]
    assert np.abs(np.diff(path, axis=0)).max() < 0.05
    assert np.linalg.norm(retarget(bent_pose(body, relb=(0.0, 1.6 * np.pi, 0.0)))) <= np.pi
    retarget(bent_pose(body, relb=(0.0, 0.95 * np.pi, 0.0)))
    retarget(bent_pose(body, relb=(0.0, 1.2 * np.pi, 0.0)))
    retarget.reset()
    assert np.linalg.norm(retarget(bent_pose(body, relb=(0.0, 1.2 * np.pi, 0.0)))) <= np.pi


def test_arms_out_and_legs_straight(servo20):
    pose = angles(servo20, bent_pose(human()))
    assert pose["r_shoulder_roll"] == pytest.approx(-QUARTER, abs=1e-6)
    assert pose["l_shoulder_roll"] == pytest.approx(QUARTER, abs=1e-6)
    for joint in ("r_elbow", "l_knee", "r_hip_pitch", "l_hip_roll", "r_hip_yaw", "head_pan", "head_tilt"):
        assert pose[joint] == pytest.approx(0.0, abs=1e-6)


def test_arms_hang_and_elbows_bend(servo20):
    pose = angles(servo20, bent_pose(human(), relb=(QUARTER, 0, 0), rwri=(0, 0, 0.8), lelb=(-QUARTER, 0, 0)))
    for joint in ("r_shoulder_roll", "r_shoulder_pitch", "l_shoulder_roll", "l_shoulder_pitch", "l_elbow"):
        assert pose[joint] == pytest.approx(0.0, abs=1e-6)
    assert pose["r_elbow"] == pytest.approx(0.8, abs=1e-6)


def test_an_arm_held_ahead_is_pitched_up(servo20):
    pose = angles(servo20, bent_pose(human(), relb=(0, 0, QUARTER)))
    assert pose["r_shoulder_pitch"] == pytest.approx(-QUARTER, abs=1e-6)
    assert pose["r_shoulder_roll"] == pytest.approx(0.0, abs=1e-6)


def test_sitting_bends_hips_and_knees_and_keeps_the_feet_flat(servo20):
    pose = angles(servo20, bent_pose(human(), rkne=(0, -QUARTER, 0), rank=(0, QUARTER, 0), rfoo=(0, 0.3, 0)))
    assert pose["r_hip_pitch"] == pytest.approx(-QUARTER, abs=1e-6)
    assert pose["r_knee"] == pytest.approx(QUARTER, abs=1e-6)
    for joint in ("r_ankle_pitch", "r_ankle_roll", "r_hip_roll", "r_hip_yaw"):
        assert pose[joint] == pytest.approx(0.0, abs=1e-6)


def test_a_foot_turned_out_turns_the_hip_and_a_leg_spread_rolls_it(servo20):
    assert angles(servo20, bent_pose(human(), lkne=(0, 0, 0.5)))["l_hip_yaw"] == pytest.approx(0.5, abs=1e-6)
    spread = angles(servo20, bent_pose(human(), lkne=(0.4, 0, 0), lfoo=(0, 0.3, 0)))
    assert spread["l_hip_roll"] == pytest.approx(0.4, abs=1e-6)
    assert spread["l_ankle_roll"] == pytest.approx(-0.4 * np.cos(0.4) ** 2, abs=1e-6)


def test_the_head_pans_and_tilts(servo20):
    assert angles(servo20, bent_pose(human(), head=(0, 0, 0.6)))["head_pan"] == pytest.approx(0.6, abs=1e-6)
    assert angles(servo20, bent_pose(human(), head=(0, 0.4, 0)))["head_tilt"] == pytest.approx(0.4, abs=1e-6)


@pytest.mark.thorough
@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1))
@example(230)  # rounding once led past the end of a range by the last digit
def test_servo_angles_stay_in_range_and_move_no_faster_than_their_bones_allow(seed):
    body = human()
    robot = load_robot(ROBOTS / "servo20.toml", body)
    poses = smooth_poses(body, np.random.default_rng(seed), 120)
    index = [body.index(side + bone) for side in "rl" for bone in ("kne", "ank", "foo", "elb", "wri")]
    path, seen = [], []
    for pose in poses:
        path.append(robot.retarget(pose))
        # Bones are seen from the robot's trunk, which points as the human's does.
        world = rotate(pose.rotation[1:][index], body.rest_direction[index])
        seen.append(world @ robot.retarget._trunk.pelvis)
    path = np.array(path)
    assert np.all((path >= robot.limits.lower) & (path <= robot.limits.upper))
    moved = np.linalg.norm(np.diff(seen, axis=0), axis=-1).max(axis=1)
    limbs = [joint for joint, name in enumerate(robot.joints) if not name.startswith("head")]
    assert np.all(np.abs(np.diff(path[:, limbs], axis=0)).max(axis=1) <= 2.0 * GAIN * moved + 0.005 * SETTLE + 1e-9)


def test_an_arm_swung_through_straight_sideways_does_not_spin(servo20):
    servo20.retarget.reset()
    body, joint = human(), servo20.joints.index("r_shoulder_pitch")
    # From a little ahead of straight out to a little behind: the pitch that fits exactly would flip by half a turn.
    path = [servo20.retarget(bent_pose(body, relb=(0, 0, turn))) for turn in np.linspace(0.3, -0.3, 150)]
    assert np.abs(np.diff(np.array(path)[:, joint])).max() < 0.06


def test_an_arm_out_sideways_with_its_forearm_up_has_its_forearm_up(servo20):
    pose = angles(servo20, bent_pose(human(), rwri=(-QUARTER, 0, 0), lwri=(QUARTER, 0, 0)))
    for side, out in (("r", -QUARTER), ("l", QUARTER)):
        assert pose[f"{side}_shoulder_pitch"] == pytest.approx(-QUARTER, abs=1e-6)
        assert pose[f"{side}_shoulder_roll"] == pytest.approx(out, abs=1e-6)
        assert pose[f"{side}_elbow"] == pytest.approx(QUARTER, abs=1e-6)


def test_a_hook_past_sideways_swings_the_shoulder_no_faster_than_the_arm(servo20):
    servo20.retarget.reset()
    body, joint = human(), servo20.joints.index("r_shoulder_pitch")
    swing = np.linspace(0.6, -0.6, 120)
    # A little ahead of straight out, the elbow bent: from below to above. The upper arm alone would ask for 2.5 rad.
    path = [servo20.retarget(bent_pose(body, relb=(turn, 0, 0.2), rwri=(-1.2, 0, 0)))[joint] for turn in swing]
    assert np.ptp(path) < 1.5
    assert np.abs(np.diff(path)).max() < 2.0 * 1.2 / 120


def test_a_pose_held_is_reached_wherever_one_comes_from(servo20):
    body = human()
    goal = bent_pose(body, relb=(0.9, 0, 0.4), lelb=(-0.5, 0, -0.9), rkne=(0.2, -0.9, 0.1), rank=(0, 1.0, 0))
    fresh = angles(servo20, goal)
    servo20.retarget(bent_pose(body, relb=(-0.5, 0, -0.4), lkne=(0, 0.5, 0)))
    for _ in range(400):
        settled = servo20.retarget(goal)
    assert np.allclose(settled, list(fresh.values()), atol=0.03)


def arm(pitch, roll, elbow):
    """Upper arm and forearm of a servo humanoid, by matrices: Ry(pitch) Rx(roll) (0, 0, -1) and (sin e, 0, -cos e)."""
    turned = [from_rotation_vector(np.array(turn)) for turn in ((0, pitch, 0), (roll, 0, 0))]
    whole = multiply(*turned)
    return rotate(whole, np.array([0, 0, -1.0])), rotate(whole, np.array([np.sin(elbow), 0, -np.cos(elbow)]))


def alike(angles, upper, fore):
    one, other = arm(*angles)
    return one @ upper + FOREARM * other @ fore


def test_an_arm_that_swings_past_sideways_goes_over_to_the_better_solution(servo20):
    """As in a cartwheel: the elbow, which bends one way only, ends straight, though turned by half a turn it bends."""
    low, high = np.full(20, -3.0), np.full(20, 3.0)
    low[5:8], high[5:8] = (-3.9, -0.2, 0.0), (2.3, 2.1, 2.7)
    limbs = LimbAngles(low, high, 0.01)
    way = np.array(
        [[(-0.4, 0.9, -0.2), (0.0, 0.9, 0.3)], [(0.0, 1.0, 0.0), (0.4, 0.8, 0.5)], [(0.5, 0.8, 0.3), (0.8, 0.2, 0.6)]]
    )
    way /= np.linalg.norm(way, axis=2)[:, :, None]
    direction = np.tile([0.0, 0.0, -1.0], (len(LIMBS), 1))
    direction[10] = 1.0, 0.0, 0.0
    found, short = [], []
    for at in np.linspace(0.0, 2.0, 300):
        k = min(int(at), 1)
        direction[2:4] = way[k] + (at - k) * (way[k + 1] - way[k])
        direction[2:4] /= np.linalg.norm(direction[2:4], axis=1)[:, None]
        found.append(limbs(direction.copy(), (0.0, 0.0, 1.0))[5:8])
        fresh = LimbAngles(low, high, 0.01)(direction, (0.0, 0.0, 1.0))[5:8]
        short.append(alike(fresh, *direction[2:4]) - alike(found[-1], *direction[2:4]))
    assert np.mean(short) < 0.03  # 0.08 along the nearest solution
    assert short[-1] < 1e-3
    assert np.abs(np.diff(found, axis=0)).max() < 0.15


@pytest.mark.parametrize(("upper", "fore"), [((0.3, 0.1, -1.0), (-0.5, 0.2, -1.0)), ((-0.2, 0.4, -0.7), (-0.9, 0, 0))])
def test_an_elbow_that_bends_one_way_only_leaves_the_arm_straight_halfway(upper, fore):
    """Against all angles on a grid."""
    upper, fore = (np.array(v) / np.linalg.norm(v) for v in (upper, fore))
    low, high = np.full(20, -3.0), np.full(20, 3.0)
    low[4] = 0.0
    direction = np.tile([0.0, 0.0, -1.0], (len(LIMBS), 1))
    direction[10] = 1.0, 0.0, 0.0
    direction[:2] = upper, fore
    found = LimbAngles(low, high, 0.005)(direction, (0.0, 0.0, 1.0))[2:5]
    grid = [np.linspace(-1.6, 1.6, 17), np.linspace(-1.2, 1.2, 9), np.linspace(0.0, 2.4, 7)]
    assert alike(found, upper, fore) > max(alike(angles, upper, fore) for angles in product(*grid)) - 2e-3


@pytest.mark.parametrize(("pitch", "roll", "elbow"), [(-0.4, 0.9, 0.8), (0.5, -0.8, 1.2), (-0.9, 0.7, 0.5)])
def test_an_arm_whose_roll_ends_early_comes_as_close_as_any_other_way(pitch, roll, elbow):
    """Against all angles on a grid: pitch and elbow make up for what the roll, 0.3 rad at most, cannot do."""
    upper, fore = arm(pitch, roll, elbow)
    ranges = np.full(len(SERVO_HUMANOID_JOINTS), 3.0)
    ranges[3] = 0.3
    direction = np.zeros((len(LIMBS), 3))
    direction[:, 2] = -1.0
    direction[10] = 1.0, 0.0, 0.0
    direction[:2] = upper, fore
    found = LimbAngles(-ranges, ranges, 0.005)(direction, (0.0, 0.0, 1.0))[2:5]

    def closeness(angles):
        return alike(angles, upper, fore)

    grid = [np.linspace(-1.6, 1.6, 33), np.array([-0.3, 0.0, 0.3]), np.linspace(0.0, 2.4, 25)]
    best = max(closeness(angles) for angles in product(*grid))
    assert abs(found[1]) <= 0.3
    assert closeness(found) > best - 2e-3


def test_other_joints_are_refused():
    with pytest.raises(FileFormatError, match="head_pan, head_tilt, r_shoulder_pitch"):
        ServoHumanoidRetargeter(human(), ("a", "b"), np.zeros(2), np.ones(2))


@pytest.fixture(scope="module")
def limbs():
    """The limbs of servo20 as MuJoCo has them, for measuring where they point."""
    return load_robot(ROBOTS / "servo20.toml", human(), "ik").retarget.solver.limbs


def posed(wanted):
    """The pose of a human whose limbs point in the directions (14, 3)."""
    body = human()
    pose = bent_pose(body)
    names = {"upper_arm": "elb", "forearm": "wri", "thigh": "kne", "shank": "ank", "foot": "foo"}
    for name, direction in zip(LIMBS, wanted, strict=True):
        if name[2:] in names:
            bone = body.index(name[0] + names[name[2:]])
            pose.rotation[bone + 1] = between(body.rest_direction[bone], direction)
    return pose


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_a_pose_of_the_robots_own_is_found_again(servo20, limbs, seed):
    """Its feet level sideways, as those of a standing human are kept; where the arms' pitch is certain."""
    random = np.random.default_rng(seed)
    lower, upper = np.maximum(servo20.limits.lower, -1.2), np.minimum(servo20.limits.upper, 1.2)
    q = lower + random.uniform(0.1, 0.9, len(lower)) * (upper - lower)
    for joint, angle in {"roll": 0.0, "yaw": 0.0, "pan": 0.0, "tilt": 0.0, "shoulder_roll": 0.3, "elbow": 0.7}.items():
        for k, name in enumerate(servo20.joints):
            if name.endswith(joint):
                q[k] = -angle if name.startswith("r_shoulder_roll") else angle
    limbs.place(q)
    wanted = limb_directions(limbs)
    servo20.retarget.reset()
    found = servo20.retarget(posed(wanted)).copy()
    limbs.place(found)
    rows = [k for k, name in enumerate(LIMBS) if name[1] == "_"]
    assert limb_directions(limbs)[rows] == pytest.approx(wanted[rows], abs=1e-6)
    assert found == pytest.approx(q, abs=1e-6)


def test_goals_out_of_range_are_waited_for_at_the_end_and_counted(servo20):
    reach = servo20.limits.upper[servo20.joints.index("l_hip_pitch")]
    pose = angles(servo20, bent_pose(human(), lkne=(0, float(reach) + 0.2, 0), lank=(0, -0.2, 0)))
    assert pose["l_hip_pitch"] == pytest.approx(reach)
    assert servo20.retarget.beyond > 0
    angles(servo20, bent_pose(human()))
    assert servo20.retarget.beyond == 0


def test_a_body_without_a_leg_is_refused_by_that_leg():
    """Where names tell one leg only, shape would take an arm for the other, and then miss that arm."""
    body = human()
    names = {"hip": "", "kne": "UpperLeg", "ank": "LowerLeg", "foo": "Foot", "elb": "UpperArm", "wri": "LowerArm"}
    kept = [b for b, bone in enumerate(body.bones) if bone not in ("lkne", "lank", "lfoo")]
    bones = [f"{names[n[1:]]}_{n[0].upper()}" if names.get(n[1:]) else n for n in body.bones]
    lame = Skeleton(
        "lame",
        tuple(bones[b] for b in kept),
        np.array([kept.index(p) if p >= 0 else -1 for p in body.parent[kept]]),
        body.rest_direction[kept],
        body.length[kept],
    )
    with pytest.raises(FileFormatError, match="skeleton 'lame' has no left leg; the robot needs one"):
        LimbView(lame)


def test_limbs_are_seen_on_the_body_of_the_motion():
    body, pose = human(), bent_pose(human(), rsho=(0.0, 0.0, 0.4), back=(0.0, 0.3, 0.0))
    own = body.with_offsets(body.offsets * np.linspace(0.6, 1.4, len(body))[:, None])
    view, wanted = LimbView(body), LimbView(own)(pose)
    plain = view(pose)
    assert np.abs(plain - wanted).max() > 0.02
    assert view(replace(pose, offsets=own.offsets)) == pytest.approx(wanted, abs=1e-12)
    assert view(pose) == pytest.approx(plain, abs=1e-12)  # back on the skeleton's own
