import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.motion.rotations import from_rotation_vector, multiply
from controller.motion.skeleton import Pose
from motiondeck_base.errors import FileFormatError, UnknownNameError
from sim.models.formats.model_text import urdf_speeds
from sim.models.joint_layout import JointLayout
from sim.models.model_file import read_model
from sim.models.robot_file import read_robot_file
from sim.models.surface import LowestPoint
from sim.physics.played_motions import DT
from sim.retargeting.human_limbs import LIMBS, LimbView
from sim.retargeting.robot_limbs import RobotLimbs, limb_directions
from sim.robots.body_matching import match
from sim.robots.calibrate import calibrate, standing_human
from sim.robots.limb_directions import LimbDirections
from sim.robots.robot import load_robot
from simulated_bodies import bent_pose, human, smooth_poses
from small_robots import LEG, SERVOS, calibrated, full_humanoid, humanoid, urdf

pytestmark = pytest.mark.smoke

MASS = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'


def model_file(tmp_path, text, name="small.xml"):
    path = tmp_path / name
    path.write_text(text)
    return path


def robot_file(tmp_path, text, name="small.xml"):
    found = calibrated(model_file(tmp_path, text, name))
    path = tmp_path / "small.toml"
    path.write_text(found.to_toml(tmp_path))
    return path


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return load_robot(robot_file(tmp_path_factory.mktemp("robot"), humanoid()), human(), "ik")


@pytest.mark.parametrize(
    ("turned", "upright"),
    [("0 0 0", [1.0, 0.0, 0.0, 0.0]), ("0 0 1.2", [1.0, 0.0, 0.0, 0.0])],
)
def test_the_parts_are_found_whatever_way_the_robot_faces(tmp_path, turned, upright):
    path = model_file(tmp_path, humanoid(body=f'pos="0 0 0.5" euler="{turned}"'))
    found = match(path, read_model(path).compile())
    assert found.parts["l_shank"] == "left_shank"
    assert found.parts["r_foot"] == "right_sole"
    assert found.parts["l_forearm"] == "left_fore"
    assert "head" not in found.parts
    assert abs(found.root_rotation @ upright) == pytest.approx(1.0, abs=1e-6)


def test_names_that_tell_no_side_leave_it_to_the_feet(tmp_path):
    path = model_file(tmp_path, humanoid().replace("left", "one").replace("right", "two"))
    assert match(path, read_model(path).compile()).parts["l_thigh"] == "one_thigh"


def test_a_calibrated_robot_stands_as_a_human_does(tmp_path):
    found = calibrated(model_file(tmp_path, humanoid()))
    assert max(found.missed.values()) < 0.05
    assert found.root_height == pytest.approx(0.4 * np.cos(0.08) + 0.03, abs=0.01)


def test_the_axes_of_a_sole_are_as_long_as_each_other_and_upright_though_the_shank_leans(tmp_path):
    text = humanoid().replace('_sole" pos="0 0 -0.2"', '_sole" pos="-0.08 0 -0.18"')
    limbs = load_robot(robot_file(tmp_path, text), human(), "ik").retarget.solver.limbs
    vectors = limbs.vectors
    ahead, up = (vectors.rest[vectors.names.index(f"l_foot_{axis}")] for axis in ("ahead", "up"))
    assert np.linalg.norm(ahead) == pytest.approx(np.linalg.norm(up))
    assert ahead @ up == pytest.approx(0.0, abs=1e-9)
    # The sole of the file is level.
    assert up / np.linalg.norm(up) == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)


def test_a_joint_that_rests_at_the_very_end_of_its_range_can_be_loaded(tmp_path):
    path = robot_file(tmp_path, humanoid().replace('range="0 2.5"', 'range="0.71234549 2.5"'))
    robot = load_robot(path, human())
    assert robot.rest[robot.joints.index("left_elbow")] == 0.71234549


def test_a_sampled_robot_lets_joints_go_as_fast_as_they_may(tmp_path):
    path = robot_file(tmp_path, humanoid())
    robot = load_robot(path, human(), dt=DT)
    robot.retarget(bent_pose(human()))
    before = robot.retarget.solver.q.copy()
    step = np.abs(robot.retarget(bent_pose(human(), rank=(0, 1.5, 0))) - before) / robot.limits.velocity / DT
    assert step.max() == pytest.approx(1.0)


def test_legs_without_solids_below_the_knee_end_at_their_ankles(tmp_path):
    text = humanoid()
    for solid in (
        'type="capsule" fromto="0 0 0 0 0 -0.2" size="0.025"',
        'type="box" pos="0.04 0 -0.02" size="0.07 0.03 0.01"',
    ):
        assert text.count(solid) == 2
        text = text.replace(f"<geom {solid}/>", MASS)
    found = calibrated(model_file(tmp_path, text, "bare.xml"))
    assert found.sound
    assert found.segments[1].length == pytest.approx([0.2, 0.2], abs=1e-3)


def test_of_the_hinges_of_a_knee_the_one_that_turns_farthest_folds_it(tmp_path):
    """As in models of muscles and bones: the shank also leans aside and turns, by little."""
    little = '<joint name="{s}_knee_{k}" axis="{axis}" range="-.03 .03"/>'
    text = humanoid()
    for s in ("left", "right"):
        knee = f'<joint name="{s}_knee" axis="0 1 0" range="0 2.4"/>'
        more = little.format(s=s, k="lean", axis="1 0 0") + little.format(s=s, k="turn", axis="0 0 1")
        assert knee in text
        text = text.replace(knee, knee + more)
    found = calibrated(model_file(tmp_path, text, "lean.xml"))
    assert found.segments[1].hinge == ("right_knee", "left_knee")
    assert found.sound


def test_signs_and_zeros_of_the_angle_solver_are_found(tmp_path):
    found = calibrated(model_file(tmp_path, humanoid()))
    signs = {name: angle.sign for name, angle in found.angles.items()}
    assert signs["l_hip_roll"] == 1
    assert signs["r_hip_roll"] == -1
    assert signs["r_ankle_pitch"] == -1
    assert all(abs(angle.zero) < 0.02 for angle in found.angles.values())
    assert {angle.joint for angle in found.angles.values()} == set(SERVOS)


def test_both_solvers_pose_the_limbs_alike(tmp_path):
    path = robot_file(tmp_path, humanoid())
    pose = bent_pose(
        human(), relb=(1.2, 0, 0.3), lelb=(-1.2, 0, 0), rkne=(0, -0.6, 0), rank=(0, 0.9, 0), rwri=(0, 0, 0.5)
    )
    ik, angles = (load_robot(path, human(), solver).retarget(pose).copy() for solver in ("ik", "angles"))
    assert np.abs(ik - angles).max() < 0.15


def test_limbs_lie_as_the_humans_do(robot):
    body, view = human(), LimbView(human())
    robot.retarget.reset()
    pose = bent_pose(body, relb=(1.3, 0, 0.2), lelb=(-1.3, 0, 0.2), lkne=(0, -0.7, 0), lank=(0, 0.9, 0))
    robot.retarget(pose)
    there = limb_directions(robot.retarget.solver.limbs)
    for limb in ("r_upper_arm", "r_forearm", "l_thigh", "l_shank", "r_thigh"):
        row = LIMBS.index(limb)
        assert there[row] @ view(pose)[row] > np.cos(0.08)


@pytest.mark.parametrize("hung", [False, True], ids=["its pelvis", "its trunk"])
def test_a_robot_does_as_a_human_whose_waist_bends_whatever_body_is_its_free_root(tmp_path, hung):
    path = robot_file(tmp_path, full_humanoid(hung=hung, fingers=False))
    body, robot, file = human(), load_robot(path, human(), dt=0.05), read_robot_file(path)
    pose = bent_pose(body, neck=(0.1, 0.4, 0.5), lkne=(0, -0.7, 0), lank=(0, 0.9, 0), relb=(1.0, 0, 0.2))
    lean = from_rotation_vector(np.array([0.2, 0.1, 0.6]))
    pose = Pose(pose.root_position, pose.heading, multiply(lean, pose.rotation))
    qpos = robot.model.qpos0.copy()
    for _ in range(40):
        robot.place(robot.retarget(pose), pose, qpos)
    directions = LimbDirections(robot.model, file.parts, np.array(file.root_rotation))
    human_limbs = LimbView(body)(pose)[None]
    assert directions.degrees(qpos[None], human_limbs).max() < 5.0
    assert directions.trunk_errors(qpos[None], human_limbs)[0] < 1.0
    data = mujoco.MjData(robot.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(robot.model, data)
    assert LowestPoint(robot.model)(data) == pytest.approx(0.0, abs=1e-6)
    assert robot.path_scale * body.leg_length == pytest.approx(data.body(file.parts["pelvis"]).xpos[2], rel=0.1)


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_inverse_kinematics_obeys_range_and_pace_and_never_jumps(robot, seed):
    robot.retarget.reset()
    poses = smooth_poses(human(), np.random.default_rng(seed), 60, reach=2.5, step=0.2)
    path = np.array([robot.retarget(pose).copy() for pose in poses])
    assert np.isfinite(path).all()
    assert np.all((path >= robot.limits.lower - 1e-9) & (path <= robot.limits.upper + 1e-9))
    assert np.all(np.abs(np.diff(path, axis=0)) <= robot.limits.velocity * 0.005 + 1e-9)


def test_what_cannot_be_reached_is_reported(robot):
    robot.retarget.reset()
    # A knee cannot bend forward.
    for _ in range(5):
        robot.retarget(bent_pose(human(), rank=(0, -1.0, 0)))
    missed = robot.retarget.solver.shortfall()
    assert missed["r_leg"]["worst_m"] > 0.02
    assert missed["l_leg"]["worst_m"] < 0.01


ROLLING_KNEE = (
    """<joint name="{s}_knee_aside" axis="1 0 0"/><joint name="{s}_knee_slide" type="slide" axis="0.6 0 0.8"/>"""
)


def anatomical():
    """A humanoid whose knees roll aside and slide while they bend, as in OpenSim's models of a human."""
    text, ties = humanoid(), ""
    for side in ("left", "right"):
        hinge = f'<joint name="{side}_knee" axis="0 1 0" range="0 2.4"/>'
        assert hinge in text
        text = text.replace(hinge, hinge + ROLLING_KNEE.format(s=side))
        for follower, curve in (("aside", "0 0.02 0.05 0 0"), ("slide", "0 -0.01 0.004 0 0")):
            ties += f'<joint joint1="{side}_knee_{follower}" joint2="{side}_knee" polycoef="{curve}"/>'
    return text.replace("</mujoco>", f"<equality>{ties}</equality></mujoco>")


def test_what_follows_a_knee_in_its_own_body_is_no_knee(tmp_path):
    found = calibrated(model_file(tmp_path, anatomical()))
    assert found.sound
    assert found.unplayed == found.undriven == ()
    (shank,) = [segment for segment in found.segments if segment.part == "shank"]
    assert shank.hinge == ("right_knee", "left_knee")


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("build", [humanoid, anatomical])
def test_how_vectors_turn_with_joints_is_their_derivative(tmp_path, build, seed):
    robot = load_robot(robot_file(tmp_path, build()), human())
    limbs, random = robot.retarget.solver.limbs, np.random.default_rng(seed)
    q = np.clip(robot.rest + random.uniform(-0.4, 0.4, len(robot.rest)), robot.limits.lower, robot.limits.upper)
    limbs.place(q)
    start, end = limbs.positions()
    turn = limbs.jacobian(np.stack([start, end])).copy()
    for joint in range(len(q)):
        limbs.place(q + 1e-6 * np.eye(len(q))[joint])
        there = limbs.positions()
        assert np.allclose((there[1] - there[0] - (end - start)) / 1e-6, turn[:, :, joint], atol=1e-5)


def test_a_robot_without_a_free_root_gets_one(tmp_path):
    assert calibrate(model_file(tmp_path, humanoid(free=""))).parts["pelvis"] == "trunk"


def test_a_root_that_lies_on_the_floor_is_moved_to_the_pelvis(tmp_path):
    """As robosuite wraps its robots: the base is on the floor and the pelvis a fixed body above it."""
    text = humanoid(free="", extra='<equality><connect body1="base" body2="left_sole" anchor=".1 .2 .5"/></equality>')
    text = text.replace('<body name="trunk" pos="0 0 0.5">', '<body name="base"><body name="trunk" pos="0 0 0.5">')
    text = text.replace("</body>\n    </worldbody>", "</body></body></worldbody>")
    path = model_file(tmp_path, text)
    model = read_model(path).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert data.body("base").xpos == pytest.approx([0.0, 0.0, 0.5])
    assert data.body("left_sole").xpos == pytest.approx([0.0, 0.06, 0.1])
    assert model.eq_data[0, :3] == pytest.approx([0.1, 0.2, 0.0])
    assert calibrate(path).root_height == pytest.approx(0.4 * np.cos(0.08) + 0.03, abs=0.01)


def test_a_root_turned_by_half_a_turn_has_no_rest_of_rounding(tmp_path):
    found = replace(calibrated(model_file(tmp_path, humanoid())), root_rotation=np.array([6.1e-17, 0.0, 0.0, -1.0]))
    (tmp_path / "small.toml").write_text(found.to_toml(tmp_path))
    assert read_robot_file(tmp_path / "small.toml").root_rotation == (0.0, 0.0, 0.0, -1.0)


@pytest.mark.parametrize("free", ["<freejoint/>", ""])
def test_a_root_below_the_floor_gets_a_new_origin_between_its_hips(tmp_path, free):
    text = (
        humanoid(free, body='pos="0 0 -0.2"')
        .replace('pos="0 0.06 0"', 'pos="0 0.06 0.7"')
        .replace('pos="0 -0.06 0"', 'pos="0 -0.06 0.7"')
    )
    text = text.replace("0.25", "0.95").replace("0 0 0.13", "0 0 0.83")
    found = calibrated(model_file(tmp_path, text))
    assert found.root_height == pytest.approx(0.4 * np.cos(0.08) + 0.03, abs=0.01)
    model = read_model(found.model).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert data.body("trunk").xpos == pytest.approx([0.0, 0.0, 0.5])
    assert data.body("left_sole").xpos == pytest.approx([0.0, 0.06, 0.1])
    assert data.geom_xpos[model.geom_bodyid == data.body("trunk").id][0] == pytest.approx([0.0, 0.0, 0.63])


def test_a_urdf_stands_on_its_legs(tmp_path):
    path = robot_file(tmp_path, urdf(), "legs.urdf")
    robot = load_robot(path, human())
    assert len(robot.joints) == 6
    assert robot.model.jnt_type[0] == 0
    assert set(robot.model.actuator_forcerange.ravel()) == {-5.0, 5.0}
    qpos = np.zeros(robot.model.nq)
    robot.place(robot.retarget(bent_pose(human())), bent_pose(human()), qpos)
    assert qpos[2] == pytest.approx(0.44, abs=0.02)


def test_a_joint_that_follows_another_is_not_played_but_goes_along(tmp_path):
    trunk = '<body name="lid" pos="0 0 0.3"><joint name="lid" axis="0 1 0"/><geom size="0.02"/></body>'
    extra = '<equality><joint joint1="lid" joint2="left_knee" polycoef="0.1 -0.5 0 0 0"/></equality>'
    robot = load_robot(robot_file(tmp_path, humanoid(trunk=trunk, extra=extra, servos=[*SERVOS, "lid"])), human())
    assert "lid" not in robot.joints
    targets, qpos = robot.rest.copy(), np.zeros(robot.model.nq)
    targets[robot.joints.index("left_knee")] = 0.8
    robot.layout.place(targets, qpos)
    assert qpos[robot.model.joint("lid").qposadr[0]] == pytest.approx(0.1 - 0.5 * 0.8)


def test_what_follows_a_follower_goes_along(tmp_path):
    lids = "".join(f'<body><joint name="{name}" axis="0 1 0"/><geom size="0.02"/></body>' for name in ("lid", "flap"))
    ties = (("flap", "lid", "0 2"), ("lid", "left_knee", "0.1 -0.5"))  # the last of the chain stands first in the file
    extra = "".join(f'<joint joint1="{a}" joint2="{b}" polycoef="{c} 0 0 0"/>' for a, b, c in ties)
    text = humanoid(trunk=lids, extra=f"<equality>{extra}</equality>", servos=())
    model = read_model(model_file(tmp_path, text)).compile()
    layout, qpos = JointLayout.of(model), np.zeros(model.nq)
    targets = np.zeros(len(layout.joints))
    targets[layout.joints.index("left_knee")] = 0.8
    layout.place(targets, qpos)
    assert qpos[model.joint("lid").qposadr[0]] == pytest.approx(0.1 - 0.5 * 0.8)
    assert qpos[model.joint("flap").qposadr[0]] == pytest.approx(2.0 * (0.1 - 0.5 * 0.8))


LID = '<body name="lid" pos="0 0 0.3"><joint name="lid" axis="0 1 0" ref="0.2"/><geom size="0.02"/></body>'


@pytest.mark.parametrize(
    ("equality", "follows"),
    [
        (
            'joint1="lid" joint2="left_knee" polycoef="0.1 -0.5 0.3 0 0"',
            lambda x: 0.3 - 0.5 * (x - 0.1) + 0.3 * (x - 0.1) ** 2,
        ),
        ('joint1="lid" polycoef="0.1 0 0 0 0"', lambda x: 0.3),
    ],
)
def test_who_follows_does_as_in_mujoco(tmp_path, equality, follows):
    text = humanoid(trunk=LID, extra=f"<equality><joint {equality}/></equality>", servos=[*SERVOS, "lid"])
    robot = load_robot(
        robot_file(tmp_path, text.replace('name="left_knee" axis', 'name="left_knee" ref="0.1" axis')), human()
    )
    assert "lid" not in robot.joints
    data, targets = mujoco.MjData(robot.model), robot.rest.copy()
    targets[robot.joints.index("left_knee")] = 0.8
    robot.layout.place(targets, data.qpos)
    assert data.qpos[robot.model.joint("lid").qposadr[0]] == pytest.approx(follows(0.8))
    mujoco.mj_forward(robot.model, data)
    mine = data.efc_id[: data.ne] == np.flatnonzero(robot.model.eq_type == mujoco.mjtEq.mjEQ_JOINT)[0]
    assert data.efc_pos[: data.ne][mine] == pytest.approx(0.0, abs=1e-9)


def test_a_coupling_that_is_not_active_is_none(tmp_path):
    extra = '<equality><joint joint1="lid" joint2="left_knee" active="false"/></equality>'
    model = read_model(model_file(tmp_path, humanoid(trunk=LID, extra=extra, servos=[*SERVOS, "lid"]))).compile()
    assert "lid" in JointLayout.of(model).joints


def test_sensors_and_contact_pairs_on_what_is_left_out_go_with_it(tmp_path):
    table = '<body name="table" pos="2 0 0"><geom name="top" size="0.3"/><site name="spot"/></body></worldbody>'
    extra = (
        '<contact><pair geom1="floor" geom2="top"/></contact>'
        '<sensor><framepos objtype="site" objname="spot"/><touch site="spot"/></sensor>'
    )
    text = humanoid(extra=extra).replace("</worldbody>", table)
    assert read_model(model_file(tmp_path, text)).compile().nsensor == 0


SKIN = (
    '<deformable><skin vertex="0 0 0 1 0 0 0 1 0" face="0 1 2"><bone body="{}" bindpos="0 0 0" bindquat="1 0 0 0" '
    'vertid="0 1 2" vertweight="1 1 1"/></skin></deformable>'
)
CLOTH = (
    '<flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" pos="2 0 1" dim="2" radius=".01">'
    '<edge equality="true"/></flexcomp>'
)


@pytest.mark.parametrize(
    ("beside", "extra"),
    [
        ("", SKIN.format("table")),
        (CLOTH, ""),
        ("", '<custom><tuple name="both"><element objtype="body" objname="table"/></tuple></custom>'),
    ],
)
def test_skins_cloths_and_lists_of_what_is_left_out_go_with_it(tmp_path, beside, extra):
    table = f'{beside}<body name="table" pos="2 0 0"><geom size="0.3"/></body></worldbody>'
    text = humanoid(extra=extra).replace("</worldbody>", table)
    model = read_model(model_file(tmp_path, text)).compile()
    assert (model.nskin, model.nflex, model.ntuple) == (0, 0, 0)
    own = read_model(model_file(tmp_path, humanoid(extra=SKIN.format("trunk")))).compile()
    assert own.nskin == 1


@pytest.mark.parametrize(
    "looking", ['<camera mode="targetbody" target="ball"/>', '<light mode="targetbodycom" target="ball"/>']
)
def test_cameras_and_lamps_that_follow_what_is_left_out_go_with_it(tmp_path, looking):
    ball = '<body name="ball" pos="2 0 0"><freejoint/><geom size="0.1"/></body></worldbody>'
    text = humanoid(trunk=looking + '<camera mode="targetbody" target="left_hip"/>').replace("</worldbody>", ball)
    model = read_model(model_file(tmp_path, text)).compile()
    assert (model.ncam, model.nlight) == (1, 0)


@pytest.mark.parametrize("free", ["<freejoint/>", ""])
def test_the_robot_of_a_scene_is_what_has_joints_whatever_stands_before_it(tmp_path, free):
    ball = '<worldbody><body name="ball" pos="2 0 0"><freejoint/><geom size="0.1"/></body>'
    door = '<body name="door" pos="0 3 0"><joint axis="0 0 1"/><geom size="0.1 0.1 1" type="box"/></body>'
    (tmp_path / "scene.xml").write_text(humanoid(free=free).replace("<worldbody>", ball + door))
    (tmp_path / "alone.xml").write_text(humanoid(free=free))
    assert calibrated(tmp_path / "scene.xml").joints == calibrated(tmp_path / "alone.xml").joints


def test_servos_that_have_no_gains_are_given_some(tmp_path):
    motors = humanoid().replace("<position ", '<motor gear="10" ctrlrange="-1 1" ').replace(' kp="20"', "")
    model = read_model(model_file(tmp_path, motors)).compile()
    assert np.all(model.actuator_gainprm[:, 0] > 0.0)
    assert np.allclose(model.actuator_forcerange, [[-10.0, 10.0]] * model.nu)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (re.sub("<geom[^>]*>", "", re.sub("<body[^>]*>", lambda m: m[0] + MASS, humanoid())), "solid"),
        (re.sub("<collision>.*?</collision>", "", urdf()), "solid.*collision"),
        (
            '<mujoco><worldbody><body name="base"><joint name="j"/><geom size="1"/></body></worldbody></mujoco>',
            "joint 'j'",
        ),
        ('<mujoco><worldbody><body name="base"><geom size="1"/></body></worldbody></mujoco>', "no hinge joint"),
        (
            '<mujoco><worldbody><body name="base"><geom size="1"/><body><joint/><geom size="1"/></body></body>'
            "</worldbody></mujoco>",
            "legs",
        ),
        (humanoid(servos=["left_knee"]).replace(LEG.format(s="right", x=0, y=-0.06, sign=-1), ""), "legs"),
    ],
)
def test_models_that_are_no_humanoids_are_named_with_the_reason(tmp_path, text, complaint):
    with pytest.raises(FileFormatError, match=rf"small\.xml.*{complaint}"):
        calibrate(model_file(tmp_path, text))


def test_a_urdf_says_how_fast_its_joints_may_turn(tmp_path):
    text = urdf().replace('velocity="4"', 'velocity="nan"', 1).replace('velocity="4"', 'velocity="6.5"', 1)
    text = text.replace('velocity="4"', 'velocity="100"', 1)
    path = robot_file(tmp_path, text, "legs.urdf")
    robot = load_robot(path, human())
    speeds = dict(zip(robot.joints, robot.limits.velocity.tolist(), strict=True))
    assert speeds["l_hip"] == 10.0  # none that could be used: the guess
    assert speeds["l_knee"] == 6.5
    assert speeds["l_ankle"] == 10.0  # faster than any servo
    assert speeds["r_ankle"] == 4.0


def test_a_urdf_with_entities_is_refused(tmp_path):
    text = '<!DOCTYPE robot [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]>' + urdf()
    with pytest.raises(FileFormatError, match=r"legs\.urdf.*DOCTYPE"):
        urdf_speeds(model_file(tmp_path, text, "legs.urdf"))


@pytest.mark.parametrize("text", ["", "<robot", '<robot><joint name="a"/><limit velocity="3"/></robot>', humanoid()])
def test_what_says_no_speed_has_none(tmp_path, text):
    assert urdf_speeds(model_file(tmp_path, text)) == {}


def test_hinges_that_no_actuator_drives_are_named_and_a_limp_knee_is_an_error(tmp_path):
    limp = ("left_knee", "right_ankle_roll")
    found = calibrated(model_file(tmp_path, humanoid(servos=[name for name in SERVOS if name not in limp])))
    assert set(found.undriven) == set(limp)
    assert not found.sound
    (doubt,) = [doubt for doubt in found.doubts if doubt.fatal]
    assert doubt.part == "l_shank"
    assert "no actuator of the model drives 'left_knee'" in doubt.words


def test_closed_chains_are_counted(tmp_path):
    chain = '<equality><connect body1="left_sole" body2="right_sole" anchor="0 0 0" active="{}"/></equality>'
    assert calibrate(model_file(tmp_path, humanoid(extra=chain.format("true")))).open_chains == 1
    assert calibrate(model_file(tmp_path, humanoid(extra=chain.format("false")))).open_chains == 0


@pytest.mark.parametrize(
    ("was", "becomes", "error", "complaint"),
    [
        (
            'l_shank = "left_shank"',
            'l_shank = "left_shin"',
            UnknownNameError,
            r"parts\.l_shank: unknown body 'left_shin'",
        ),
        ('l_shank = "left_shank"', 'l_shin = "left_shank"', UnknownNameError, "unknown part 'l_shin'"),
        ('l_shank = "left_shank"\n', "", FileFormatError, r"parts\.l_shank is missing"),
        ('l_shank = "left_shank"', 'l_shank = "trunk"', FileFormatError, "no hinge joint at body 'trunk'"),
        ('joint = "left_knee"', 'joint = "left_kne"', UnknownNameError, "unknown joint 'left_kne'.*left_knee"),
        ("root_rotation = [1, 0, 0, 0]", "root_rotation = [1, 1, 0, 0]", FileFormatError, "no unit quaternion"),
        ('solver = "ik"', 'solver = "magic"', FileFormatError, "solver"),
    ],
)
def test_a_robot_file_that_does_not_fit_its_model_is_named(tmp_path, was, becomes, error, complaint):
    path = robot_file(tmp_path, humanoid())
    text = path.read_text()
    assert was in text
    path.write_text(text.replace(was, becomes))
    with pytest.raises(error, match=complaint):
        load_robot(path, human(), "angles" if "kne'" in complaint else None)


def test_standing_feet_do_not_slide_and_nothing_sinks(robot):
    """A human that sways over still feet, on a floor 8 cm too high."""
    body, lowest_point = human(), LowestPoint(robot.model)
    robot.retarget.reset()
    robot.footing.reset()
    data, feet = mujoco.MjData(robot.model), []
    for frame in range(80):
        sway = 0.25 * np.sin(0.1 * frame)
        pose = bent_pose(body, rkne=(0, -sway, 0), lkne=(0, -sway, 0), rfoo=(0, sway + 0.3, 0), lfoo=(0, sway + 0.3, 0))
        # The root goes back and forth above feet that stand.
        ankle = body.joints(pose.root_position, pose.rotation)[1 + body.index("rank")]
        pose = Pose(pose.root_position - ankle + np.array([0.0, 0.0, 0.16]), pose.heading, pose.rotation)
        robot.place(robot.retarget(pose), pose, data.qpos)
        mujoco.mj_kinematics(robot.model, data)
        feet.append(data.body("right_sole").xpos[:2].copy())
        assert abs(lowest_point(data)) < 1e-6
    assert np.ptp(feet[5:], axis=0).max() < 0.01


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh"])
def test_the_lowest_point_is_where_a_floor_that_is_touched_would_be(kind, seed):
    random = np.random.default_rng(seed)
    corners = random.normal(size=(30, 3))
    spec = mujoco.MjSpec()
    spec.add_mesh(name="rock", uservert=corners.ravel())
    body = spec.worldbody.add_body(quat=random.normal(size=4), pos=[0, 0, 1])
    body.add_freejoint()
    geom = body.add_geom(
        type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}"), size=random.uniform(0.2, 0.6, 3), mass=1
    )
    geom.meshname = "rock" if kind == "mesh" else ""
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1], pos=[0, 0, -5])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    low = LowestPoint(model)(data)
    for off, touches in ((-1e-4, True), (1e-4, False)):
        data.qpos[2] = 1.0 - 5.0 - low + off
        mujoco.mj_forward(model, data)
        assert (data.ncon > 0) == touches


def test_a_leap_leaves_the_floor(robot):
    robot.footing.reset()
    stand = bent_pose(human(), rfoo=(0, 0.3, 0), lfoo=(0, 0.3, 0))
    qpos, heights = np.zeros(robot.model.nq), []
    targets = robot.retarget(stand)
    for up in (0.0, 0.0, 0.1, 0.3, 0.1, 0.0):
        robot.place(targets, Pose(stand.root_position + np.array([0.0, 0.0, up]), stand.heading, stand.rotation), qpos)
        heights.append(qpos[2])
    assert heights[3] - heights[0] == pytest.approx(0.28 * robot.path_scale, abs=0.02)
    assert heights[5] == pytest.approx(heights[0], abs=1e-6)


def test_the_standing_human_is_made_of_unit_vectors():
    assert np.allclose(np.linalg.norm(standing_human(), axis=1), 1.0)


def test_inverse_kinematics_needs_parts(tmp_path):
    path = robot_file(tmp_path, humanoid())
    text = path.read_text()
    path.write_text(text[: text.index("[parts]")] + text[text.index("[rest]") :])
    with pytest.raises(FileFormatError, match=r"\[parts\].*calibrate"):
        load_robot(path, human())


def test_limbs_can_be_asked_for_their_reach(tmp_path):
    path = model_file(tmp_path, humanoid())
    model = read_model(path).compile()
    limbs = RobotLimbs(path, model, match(path, model).parts, np.array([1.0, 0, 0, 0]), tuple(SERVOS))
    assert limbs.reach["l_leg"] == pytest.approx(0.4)
    assert limbs.reach["r_arm"] == pytest.approx(0.3)
