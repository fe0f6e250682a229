import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.motion.anatomy import anatomy
from controller.motion.clip import ReadingOptions
from controller.motion.formats.jaeger_patterns import read_pattern
from controller.motion.formats.reading import read_clip
from controller.motion.skeleton import Pose
from shipped_libraries import shipped
from sim.models.joint_layout import JointLayout
from sim.models.mannequin.mannequin import build_mannequin, fit_mannequin
from sim.models.mannequin.solids import stature
from sim.models.surface import reach
from sim.physics.physics_model import feet_of
from sim.physics.playback import PhysicsPlayback
from sim.retargeting.retarget import MannequinRetargeter
from sim.robots.robot import load_robot
from sim.robots.self_collision import SelfCollision
from simulated_bodies import ROBOTS, bent_pose, human, random_pose, skeletons


def joint_error(model, skeleton, poses):
    """How far any joint of the mannequin is from where forward kinematics of the skeleton has it, m."""
    layout, retarget, data = JointLayout.of(model), MannequinRetargeter(skeleton), mujoco.MjData(model)
    worst = 0.0
    for pose in poses:
        data.qpos[:3], data.qpos[3:7] = pose.root_position, pose.rotation[0]
        layout.place(retarget(pose), data.qpos)
        mujoco.mj_kinematics(model, data)
        ends = np.array([data.site(bone).xpos for bone in skeleton.bones])
        joints = skeleton.joints(pose.root_position, pose.rotation)
        worst = max(worst, float(np.abs(ends - joints[1:]).max()))
    return worst


@settings(max_examples=25)
@given(skeletons(), st.integers(0, 2**32 - 1))
def test_any_pose_of_any_skeleton_plays_back_exactly(skeleton, seed):
    random = np.random.default_rng(seed)
    model = build_mannequin(skeleton).compile()
    assert joint_error(model, skeleton, [random_pose(skeleton, random) for _ in range(3)]) <= 1e-6


@pytest.mark.parametrize("motion", ["Walk", "CartWheel", "Crawl", "Waltz", "Box2"])
def test_recorded_motions_play_back_exactly(mocap_data, motion):
    file = mocap_data / "jaeger" / f"nnRaw{motion}.mat"
    if not file.is_file():
        pytest.skip(f"there is no {file}")
    clip = read_pattern(file)
    model = build_mannequin(clip.skeleton).compile()
    frames = range(0, len(clip), 7)
    poses = [Pose(clip.root_position[f], np.zeros(()), clip.rotation[f]) for f in frames]
    assert joint_error(model, clip.skeleton, poses) <= 1e-6


SKELETONS = (
    *(f"cmu/{subject}/{subject}.asf" for subject in ("02", "07", "08", "09", "10", "16", "35", "86")),
    *(f"hdm05/HDM_{actor}.asf" for actor in ("bd", "bk", "dg", "mm", "tr")),
    "bvh/cgspeed-3dsmax_cmu_131_01.bvh",
    "bvh/cgspeed-motionbuilder_cmu_12_01.bvh",
    "bvh/iclone_cmu_02_03.bvh",
    "c3d/16_36_runjog.c3d",
)


@pytest.mark.thorough
@pytest.mark.parametrize("file", SKELETONS)
def test_every_skeleton_there_is_plays_back_exactly(mocap_data, file):
    path = mocap_data / file
    skeleton = path if path.suffix == ".asf" else None
    if skeleton is not None:
        near = (
            path.parent.glob("*.amc") if file.startswith("cmu") else path.parent.glob(f"squat1Reps/{path.stem}_*.amc")
        )
        path = min(near, key=lambda recording: recording.stat().st_size)
    clip = read_clip(path, ReadingOptions(skeleton))
    model = build_mannequin(clip.skeleton).compile()
    poses = [
        Pose(clip.root_position[frame], np.zeros(()), clip.rotation[frame])
        for frame in np.linspace(0, len(clip) - 1, 20).astype(int)
    ]
    assert joint_error(model, clip.skeleton, poses) <= 1e-9
    # And the body is one that people have.
    assert 50.0 < model.body_mass.sum() < 100.0
    assert 1.5 < stature(clip.skeleton, anatomy(clip.skeleton)) < 2.0


@pytest.mark.thorough
def test_another_body_of_the_same_bones_looks_as_if_it_were_built():
    body = human()
    own = body.with_offsets(body.offsets * np.linspace(0.8, 1.2, len(body))[:, None])
    fitted, built = build_mannequin(body).compile(), build_mannequin(own).compile()
    fit_mannequin(fitted, own)
    bones = [fitted.body(bone).id for bone in body.bones]
    solids = np.isin(fitted.geom_bodyid, [1, *bones])
    assert fitted.body_pos[bones] == pytest.approx(built.body_pos[bones])
    for what in ("geom_pos", "geom_quat", "geom_size"):
        assert getattr(fitted, what)[solids] == pytest.approx(getattr(built, what)[solids])


def test_it_weighs_what_a_person_of_its_size_weighs():
    model = build_mannequin(human()).compile()
    assert 20.0 < model.body_mass.sum() / stature(human(), anatomy(human())) ** 2 < 27.0


def test_limbs_swing_as_a_person_s_do():
    """Mass, its middle and its spread of each limb are those that de Leva (1996) measured."""
    body = human()
    model = build_mannequin(body).compile()
    whole = model.body_mass.sum()
    for bone, share, centre, radius in (
        ("rkne", 0.1416, 0.41, 0.329),
        ("lank", 0.0433, 0.446, 0.252),
        ("relb", 0.0271, 0.577, 0.277),
        ("lwri", 0.0162, 0.457, 0.27),
    ):
        index, length = model.body(bone).id, body.length[body.index(bone)]
        assert model.body_mass[index] / whole == pytest.approx(share, rel=0.05)
        assert model.body_ipos[index] @ body.rest_direction[body.index(bone)] == pytest.approx(centre * length)
        most = np.sqrt(model.body_inertia[index].max() / model.body_mass[index])
        assert most == pytest.approx(radius * length)


def test_it_stands_on_the_floor_and_reaches_as_high_as_a_person():
    body = human()
    model = build_mannequin(body).compile()
    data = mujoco.MjData(model)
    data.qpos[2] = body.leg_length + 0.06
    mujoco.mj_kinematics(model, data)
    moving = model.body_weldid[model.geom_bodyid] != 0
    top = (data.geom_xpos[moving, 2] + model.geom_rbound[moving]).max()
    assert 0.9 * stature(body, anatomy(body)) < top < 1.1 * stature(body, anatomy(body))


def test_it_stands_on_the_whole_foot_and_not_on_its_toes():
    robot = load_robot(ROBOTS / "mannequin.toml", shipped("cmu86").skeleton)
    model, data = robot.model, mujoco.MjData(robot.model)
    mujoco.mj_kinematics(model, data)
    feet = feet_of(robot)
    assert [foot.body for foot in feet] == ["lfoot", "rfoot"]
    for foot, toes in zip(feet, ("ltoes", "rtoes"), strict=True):
        turned = data.body(foot.body).xmat.reshape(3, 3)
        up, sole = turned @ foot.axes[:, 2], data.body(foot.body).xpos + turned @ foot.sole
        for geom in np.flatnonzero(model.geom_bodyid == model.body(toes).id):
            below = reach(model, int(geom), -up @ data.geom_xmat[geom].reshape(3, 3))
            assert up @ (data.geom_xpos[geom] - sole) - below == pytest.approx(0.0, abs=0.002)


def test_left_and_right_limbs_differ_in_colour():
    model = build_mannequin(human()).compile()
    colours = {
        side: {model.mat(int(m)).name for m in model.geom_matid[model.geom_bodyid == model.body(f"{side}kne").id]}
        for side in "lr"
    }
    assert colours["l"].isdisjoint(colours["r"])


@settings(max_examples=20)
@given(skeletons())
def test_at_rest_nothing_touches_anything(skeleton):
    model = build_mannequin(skeleton).compile()
    data = mujoco.MjData(model)
    data.qpos[2] = -0.1
    mujoco.mj_forward(model, data)
    assert data.ncon == 0


def test_crossed_legs_stop_one_another():
    body = human()
    robot = load_robot(ROBOTS / "mannequin.toml", body)
    overlap, played, output = SelfCollision(robot), np.zeros(robot.model.nq), PhysicsPlayback(robot, 0.005)
    for share in np.linspace(0.0, 1.0, 80):
        pose = bent_pose(body, rkne=(0.35 * share, 0, 0), lkne=(-0.35 * share, 0, 0))
        targets = robot.retarget(pose)
        output.write(targets, pose)
        robot.place(targets, pose, played)
    assert output.data.ncon > 0
    assert overlap(played)[1] == "rkne and lkne"
    assert overlap(output.qpos)[0] < 0.6 * overlap(played)[0]
    assert output.report()["faults"] == 0


@pytest.mark.parametrize("bone", ["relb", "lwri", "rank", "lkne", "head"])
def test_neighbours_never_push_one_another(bone):
    body = human()
    model = build_mannequin(body).compile()
    data, targets = mujoco.MjData(model), MannequinRetargeter(body)
    JointLayout.of(model).place(targets(bent_pose(body, **{bone: (0.0, -1.3, 0.0)})), data.qpos)
    mujoco.mj_forward(model, data)
    pair = {model.body(bone).id, int(model.body(bone).parentid[0])}
    assert all(set(model.geom_bodyid[geoms].tolist()) != pair for geoms in data.contact.geom)


def test_the_model_survives_being_saved(tmp_path):
    spec = build_mannequin(human())
    model = spec.compile()
    spec.to_file(str(tmp_path / "mannequin.xml"))
    again = mujoco.MjModel.from_xml_path(str(tmp_path / "mannequin.xml"))
    assert JointLayout.of(again).joints == JointLayout.of(model).joints
    assert np.allclose(again.jnt_range, model.jnt_range)
    assert np.allclose(again.actuator_gainprm, model.actuator_gainprm, rtol=1e-4)
    assert np.allclose(again.geom_size, model.geom_size, atol=1e-4)
