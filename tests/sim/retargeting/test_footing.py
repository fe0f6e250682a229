"""Tests of the root's place above the floor."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.motion.rest_pose import FOOT_SLOPE
from controller.motion.rotations import from_rotation_vector, multiply, to_rotation_vector
from controller.motion.skeleton import Pose
from sim.models.model_file import read_model
from sim.models.surface import LowestPoint
from sim.retargeting.footing import Footing
from sim.retargeting.human_stance import FOLLOWS, STANDS, SURE, TELEPORT, HumanStance, Soles
from simulated_bodies import bent_pose, human, smooth_poses
from small_robots import humanoid

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
FLAT = {"rfoo": (0.0, FOOT_SLOPE, 0.0), "lfoo": (0.0, FOOT_SLOPE, 0.0)}
LEG, SCALE, DT = human().leg_length, 0.5, 0.01


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("footing") / "small.xml"
    path.write_text(humanoid())
    return read_model(path).compile()


@pytest.fixture
def footing(model):
    feet = [model.body(f"{side}_sole").id for side in ("right", "left")]
    return Footing(HumanStance(human(), DT), model, feet, UPRIGHT, SCALE)


def moved(pose, by, turn=(0.0, 0.0, 0.0)):
    rotation = multiply(from_rotation_vector(np.array(turn, dtype=float)), pose.rotation)
    return Pose(pose.root_position + np.array(by, dtype=float), pose.heading, rotation)


def placed(footing, model, poses, joints=None):
    """The root's places (T, 3) and the lowest points (T,) of a robot that keeps its joints where they are."""
    data, lowest_point = mujoco.MjData(model), LowestPoint(model)
    places, lowest = [], []
    for pose in poses:
        data.qpos[7:] = 0.0 if joints is None else joints
        footing.place(pose, data.qpos)
        mujoco.mj_kinematics(model, data)
        places.append(data.qpos[:3].copy())
        lowest.append(lowest_point(data))
    return np.array(places), np.array(lowest)


def test_what_does_not_collide_moves_no_root_though_it_is_below_the_floor(tmp_path):
    fore = '<body name="left_fore" pos="0 0 -0.15">'
    rod = '<geom type="capsule" fromto="0 0 0 0 0 -.9" size=".01" contype="0" conaffinity="0"/>'
    path = tmp_path / "rod.xml"
    path.write_text(humanoid().replace(fore, fore + rod))
    model = read_model(path).compile()
    feet = [model.body(f"{side}_sole").id for side in ("right", "left")]
    footing, elbow = Footing(HumanStance(human(), DT), model, feet, UPRIGHT, SCALE), model.joint("left_elbow")
    data = mujoco.MjData(model)
    for tick in range(60):
        data.qpos[elbow.qposadr[0]] = 0.01 * tick
        footing.place(bent_pose(human(), **FLAT), data.qpos)
    mujoco.mj_kinematics(model, data)
    assert data.geom_xpos[model.geom_contype == 0, 2].min() < 0.3  # of a rod of 0.9 m
    assert np.abs(data.qpos[:2]).max() < 1e-6


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_nothing_is_below_the_floor_however_the_body_lies(model, seed):
    random = np.random.default_rng(seed)
    feet = [model.body(f"{side}_sole").id for side in ("right", "left")]
    turn = 1.5 * random.normal(size=3)
    poses = [moved(pose, 0.3 * random.normal(size=3), turn) for pose in smooth_poses(human(), random, 12)]
    joints = random.uniform(-0.8, 0.8, model.nq - 7)
    _, lowest = placed(Footing(HumanStance(human(), DT), model, feet, UPRIGHT, SCALE), model, poses, joints)
    assert lowest.min() >= -1e-9


def test_who_lies_on_the_back_lies_on_the_floor(footing, model):
    lying = moved(bent_pose(human()), (0.0, 0.0, -0.7), (0.0, -np.pi / 2.0, 0.0))
    _, lowest = placed(footing, model, [lying] * 3)
    assert lowest == pytest.approx(0.0, abs=1e-9)


def test_a_leap_goes_as_high_as_the_humans_to_scale(footing, model):
    stand = bent_pose(human(), **FLAT)
    _, lowest = placed(footing, model, [stand, moved(stand, (0, 0, 0.3)), stand])
    assert lowest == pytest.approx([0.0, SCALE * (0.3 - STANDS * LEG), 0.0], abs=1e-6)


def test_a_recording_that_stands_off_the_floor_stands_on_it(footing, model):
    stand = moved(bent_pose(human(), **FLAT), (0.0, 0.0, 0.08))
    drifting = [moved(stand, (0.0, 0.0, 0.0005 * frame)) for frame in range(200)]
    _, lowest = placed(footing, model, drifting)
    assert lowest == pytest.approx(0.0, abs=1e-9)


def test_the_floor_follows_a_still_foot_upwards_at_its_pace(footing, model):
    stand = bent_pose(human(), **FLAT)
    raised = moved(stand, (0.0, 0.0, 0.2))
    wait = int(SURE / DT) + 1  # ticks of stillness, and the one in which the foot moves
    _, lowest = placed(footing, model, [stand, *[raised] * (wait + 3)])
    # Until it is sure that the foot stands the floor stays; then the gap shrinks by FOLLOWS dt a tick.
    gap = SCALE * 0.2 * (1.0 - FOLLOWS * DT) ** np.array([0, 1, 2])
    assert lowest[wait : wait + 3] == pytest.approx(np.maximum(gap - SCALE * STANDS * LEG, 0.0), abs=1e-3)


def test_at_the_top_of_a_leap_the_floor_stays_where_it_was(footing, model):
    stand, top = bent_pose(human(), **FLAT), 0.25
    up = [moved(stand, (0.0, 0.0, top - 4.9 * (DT * k) ** 2)) for k in range(-22, 23)]
    _, lowest = placed(footing, model, [stand, *up])
    assert lowest.max() == pytest.approx(SCALE * (top - STANDS * LEG), abs=2e-3)


def test_feet_that_stand_stay_where_they_are(footing, model):
    """The hips sway to and fro above still feet: the root goes where the robot's own legs carry it."""
    body = human()
    poses, joints = [], []
    for frame in range(60):
        sway = 0.15 * np.sin(0.2 * frame)
        pose = bent_pose(body, rkne=(0, -sway, 0), lkne=(0, -sway, 0), **dict.fromkeys(FLAT, (0, sway + FOOT_SLOPE, 0)))
        at = body.joints(pose.root_position, pose.rotation)[1 + body.index("rank")]
        poses.append(moved(pose, np.array([0.0, 0.0, 0.16]) - at))
        joints.append(sway)
    data, soles = mujoco.MjData(model), []
    for pose, sway in zip(poses, joints, strict=True):
        for side, sign in (("left", 1.0), ("right", -1.0)):
            data.joint(f"{side}_hip_pitch").qpos[0] = -sway
            data.joint(f"{side}_ankle").qpos[0] = sign * sway
        footing.place(pose, data.qpos)
        mujoco.mj_kinematics(model, data)
        soles.append([data.body(f"{side}_sole").xpos[:2].copy() for side in ("left", "right")])
    assert np.ptp(np.array(soles), axis=0).max() < 0.002


def test_feet_that_glide_go_with_the_human(footing, model):
    stand = bent_pose(human(), **FLAT)
    speed = 1.5 * LEG  # m/s, far above that of a foot that stands
    places, _ = placed(footing, model, [moved(stand, (speed * DT * frame, 0.0, 0.0)) for frame in range(100)])
    # This robot's shanks end close to the floor too, and whatever is no foot counts a little as if it stood.
    assert places[-1, 0] == pytest.approx(SCALE * speed * DT * 99, rel=0.05)
    assert places[:, 1] == pytest.approx(0.0, abs=1e-6)


def test_in_the_air_the_root_takes_the_humans_way_to_scale(footing, model):
    stand = bent_pose(human(), **FLAT)
    flight = [moved(stand, (0.02 * k, -0.01 * k, 0.25)) for k in range(1, 10)]
    places, _ = placed(footing, model, [stand, moved(stand, (0.0, 0.0, 0.25)), *flight])
    assert places[-1, :2] - places[1, :2] == pytest.approx([SCALE * 0.18, -SCALE * 0.09], abs=1e-3)


@pytest.mark.parametrize("share", [1.1, 0.9])
def test_after_a_leap_nobody_walked_the_robot_stands_where_the_human_stands(footing, model, share):
    stand = bent_pose(human(), **FLAT)
    step = share * TELEPORT * LEG
    slow = [moved(stand, (0.0, 0.001 * k, 0.0)) for k in range(30)]
    places, _ = placed(footing, model, [*slow, moved(slow[-1], (step, 0.0, 0.0))])
    human_at = SCALE * (slow[-1].root_position + np.array([step, 0.0, 0.0]))[:2]
    off = np.linalg.norm(places[-1, :2] - human_at)
    assert off == pytest.approx(0.0, abs=1e-9) if share > 1.0 else off > 0.002


def test_reset_forgets_the_floor_and_the_place(footing, model):
    stand = bent_pose(human(), **FLAT)
    first, _ = placed(footing, model, [stand])
    placed(footing, model, [moved(stand, (0.02 * k, 0.0, 0.05)) for k in range(20)])
    footing.reset()
    again, _ = placed(footing, model, [stand])
    assert np.array_equal(first, again)


def test_the_root_turns_with_the_human_and_its_own_way_of_standing(model):
    turned = from_rotation_vector(np.array([0.0, 0.0, 0.7]))
    footing = Footing(HumanStance(human(), DT), model, [], turned, SCALE)
    qpos = np.zeros(model.nq)
    pose = moved(bent_pose(human()), (0, 0, 0), (0.1, 0.2, 0.3))
    footing.place(pose, qpos)
    assert np.allclose(qpos[3:7], multiply(pose.rotation[0], turned))


def test_of_a_run_that_knows_the_root_only_its_path_is_taken(footing, model):
    qpos = np.zeros(model.nq)
    footing.place(Pose(np.array([1.0, 2.0, 3.0]), np.zeros(()), UPRIGHT[None]), qpos)
    assert qpos[:3] == pytest.approx([0.5, 1.0, 1.5])


def test_soles_are_heel_and_ball():
    body, flat = human(), (FOOT_SLOPE, FOOT_SLOPE)
    for more in (0.0, 0.5, -0.5):
        pose = bent_pose(body, rfoo=(0.0, FOOT_SLOPE + more, 0.0), lfoo=(0.0, FOOT_SLOPE + more, 0.0))
        soles = Soles(body)(pose, flat)
        joints = body.joints(pose.root_position, pose.rotation)
        for sole, foot in zip(soles, ("rfoo", "lfoo"), strict=True):
            assert sole.ball == pytest.approx(joints[1 + body.index(foot)])
            assert sole.ankle == pytest.approx(joints[1 + body.parent[body.index(foot)]])
            # The heel is 1.25 feet behind the ball, level with it on a flat foot.
            reach = 1.25 * 0.16 * np.cos(FOOT_SLOPE)
            there = np.array(sole.ball) + reach * np.array([-np.cos(more), 0.0, np.sin(more)])
            assert sole.heel == pytest.approx(there)
            assert sole.slope == pytest.approx(FOOT_SLOPE + more)


def test_a_foot_that_rolls_from_heel_to_toe_stays_where_it_stands(footing, model):
    """First the heel stands and the toes come down, then the ball stands and the heel rises."""
    body, slopes = human(), np.concatenate([np.linspace(-0.4, -0.01, 20), np.linspace(0.01, 0.6, 30)])
    data, corners = mujoco.MjData(model), []
    geom = model.body("left_sole").geomadr[0]
    for frame, slope in enumerate(slopes):
        sway = 0.2 * np.sin(0.1 * frame)  # of the robot's legs alone: only the root can make up for it
        pose = bent_pose(body, **dict.fromkeys(FLAT, (0.0, FOOT_SLOPE + slope, 0.0)))
        sole = Soles(body)(pose, (FOOT_SLOPE, FOOT_SLOPE))[0]
        behind = np.array([1.25 * 0.16 * np.cos(FOOT_SLOPE), 0.0, 0.0])
        stands = np.array(sole.heel) if slope < 0.0 else np.array(sole.ball) - behind
        for side, sign in (("left", 1.0), ("right", -1.0)):
            data.joint(f"{side}_hip_pitch").qpos[0] = -sway
            data.joint(f"{side}_ankle").qpos[0] = sign * (slope + sway)
        footing.place(moved(pose, -stands), data.qpos)
        mujoco.mj_kinematics(model, data)
        turn = data.geom_xmat[geom].reshape(3, 3)
        corners.append([(data.geom_xpos[geom] + turn @ [x, 0.0, -0.01])[0] for x in (-0.07, 0.07)])
    heel, toe = np.array(corners).T
    assert np.ptp(heel[1:20]) < 0.003
    assert np.ptp(toe[21:]) < 0.003
    assert min(np.ptp(heel[21:]), np.ptp(toe[1:20])) > 0.005


def test_a_toe_that_trails_does_not_drag_the_foot_that_stands(footing, model):
    """The right foot stands, held off the floor by the left one that swings back with its toes down."""
    stand = bent_pose(human(), **FLAT)
    data, places = mujoco.MjData(model), []
    for frame in range(40):
        swing = 0.02 * frame
        pose = bent_pose(human(), rfoo=FLAT["rfoo"], lkne=(0.0, swing, 0.0), lank=(0.0, 1.2, 0.0))
        sway = 0.2 * np.sin(0.1 * frame)  # of the robot's leg alone: only the root can make up for it
        data.joint("right_hip_pitch").qpos[0], data.joint("right_ankle").qpos[0] = -sway, -sway
        data.joint("left_hip_pitch").qpos[0], data.joint("left_ankle").qpos[0] = swing, 0.9
        footing.place(Pose(stand.root_position, stand.heading, pose.rotation), data.qpos)
        mujoco.mj_kinematics(model, data)
        places.append(data.body("right_sole").xpos.copy())
    assert np.array(places)[:, 2].max() > 0.02 + 0.01  # it does hang in the air
    assert np.ptp(np.array(places)[3:, :2], axis=0).max() < 0.003


def test_a_foot_that_turns_on_its_heel_does_not_drag_the_one_on_its_whole_sole(footing, model):
    stand, flat = bent_pose(human(), **FLAT), from_rotation_vector(np.array(FLAT["lfoo"]))
    data, places = mujoco.MjData(model), []
    for frame in range(25):
        turn = from_rotation_vector(np.array([0.0, 0.0, 0.04 * frame]))
        pose = bent_pose(human(), rfoo=FLAT["rfoo"], lfoo=tuple(to_rotation_vector(multiply(turn, flat))))
        data.joint("left_hip_pitch").qpos[0] = 0.004 * frame  # the sole of a robot made otherwise moves
        footing.place(Pose(stand.root_position, stand.heading, pose.rotation), data.qpos)
        mujoco.mj_kinematics(model, data)
        places.append([data.body(f"{side}_sole").xpos[:2].copy() for side in ("right", "left")])
    moved_by = np.ptp(np.array(places), axis=0).max(axis=1)
    assert moved_by[0] < 0.003
    assert moved_by[1] > 0.02
