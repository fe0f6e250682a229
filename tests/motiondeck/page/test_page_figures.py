"""What the live page draws besides the robot: the human whose motion it plays, and the marks of its feet."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import mujoco
import numpy as np
import pytest

from controller.motion.canonical.canonical_body import root_height
from controller.motion.skeleton import Pose
from motiondeck.page.body.drawn_model import DrawnModel
from motiondeck.page.body.live_marks import LiveSteps, TargetPose
from motiondeck.page.body.solids import batches, poses
from motiondeck.page.ghost import OPACITY, WAYS, Ghost, draw_ghost
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, bent_pose, human


class Drawn:
    """Stands in for a drawn model and remembers where it was put."""

    def __init__(self, model):
        self.model, self.qpos = model, None

    def show(self, qpos, centre):
        self.qpos = qpos.copy()

    def set_visible(self, visible):
        self.qpos = self.qpos if visible else None


def test_the_human_is_drawn_in_the_pose_that_is_played(tmp_path):
    skeleton = human()
    about = draw_ghost(skeleton, 0.4, tmp_path / "human.xml")
    model = mujoco.MjModel.from_xml_path(about.file)
    assert np.unique(model.mat_rgba[model.geom_matid[model.geom_bodyid > 0], 3]) == pytest.approx([OPACITY])
    drawn: Any = Drawn(model)
    pose = bent_pose(skeleton, rkne=(0.0, -0.7, 0.2), lelb=(0.3, 0.0, -0.5))
    ghost = Ghost(drawn, about, -0.3)
    beneath = np.array([2.0, 1.0])
    for way, aside in ((WAYS[1], 0.0), (WAYS[2], -0.3)):
        ghost.show(way, pose, beneath, np.zeros(2))
        data = mujoco.MjData(model)
        data.qpos[:] = drawn.qpos
        mujoco.mj_kinematics(model, data)
        root = np.array([2.0, 1.0 + aside, 0.4 * pose.root_position[2]])
        joints = root + 0.4 * (skeleton.joints(np.zeros(3), pose.rotation))
        for bone, name in enumerate(skeleton.bones):
            start = joints[skeleton.parent[bone] + 1]
            assert data.body(name).xpos == pytest.approx(start, abs=1e-5)
    ghost.show(WAYS[0], pose, beneath, np.zeros(2))
    assert drawn.qpos is None


def test_the_human_is_drawn_on_the_body_of_its_motion(tmp_path):
    skeleton = human()
    about = draw_ghost(skeleton, 0.4, tmp_path / "human.xml")
    model = mujoco.MjModel.from_xml_path(about.file)
    pose = bent_pose(skeleton, rkne=(0.0, -0.7, 0.2), lelb=(0.3, 0.0, -0.5))
    own = skeleton.with_offsets(skeleton.offsets * np.linspace(0.8, 1.2, len(skeleton))[:, None])
    drawn = DrawnModel(cast(Any, Floor()), model, 1.0)
    Ghost(drawn, about, -0.3).show(WAYS[1], replace(pose, offsets=own.offsets), np.zeros(2), np.zeros(2))
    joints = own.joints(np.array([0.0, 0.0, root_height(pose, skeleton, own)]), pose.rotation)
    for bone, name in enumerate(skeleton.bones):
        start = joints[skeleton.parent[bone] + 1]
        assert drawn.data.body(name).xpos == pytest.approx(0.4 * start, abs=1e-5)
    shank = model.geom_size[model.body("rank").geomadr[0] + 1]  # the capsule along it
    assert 2.0 * shank[1] == pytest.approx(0.4 * own.length[skeleton.index("rank")], abs=1e-5)
    for solid, batch in zip(drawn.solids, batches(model).values(), strict=True):
        assert solid.batched_scales == pytest.approx(batch.scale)


class Floor:
    """A page that remembers what is drawn on it."""

    def __init__(self):
        self.scene = self
        self.prints = []
        self.solids = {}
        self.moved = []

    def add_frame(self, name, **how):
        return SimpleNamespace()

    def add_icosphere(self, name, **how):
        return SimpleNamespace(visible=False)

    def add_mesh_simple(self, name, corners, faces, **how):
        self.prints.append(corners)

    def add_batched_meshes_simple(self, name, *mesh, **how):
        self.solids[name] = SimpleNamespace(visible=True, **how)
        return self.solids[name]

    def move_copies(self, copies, position, turn):
        copies.batched_positions, copies.batched_wxyzs = position, turn
        self.moved.append(copies)


def test_a_foot_that_stands_is_marked_and_one_that_has_stood_leaves_a_print():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    page: Any = Floor()
    data = mujoco.MjData(robot.model)
    robot.place(robot.rest, Pose(*(np.zeros(3), np.array(0.0), bent_pose(human()).rotation)), data.qpos)
    steps = LiveSteps(page, robot.model, data.qpos.copy(), 0.4)
    right = robot.joints.index("r_hip_pitch")
    for tick in range(60):
        targets = robot.rest.copy()
        if tick >= 30:  # the right leg swings, the left one stands
            targets[right] -= 0.05 * (tick - 30)
        robot.layout.place(targets, data.qpos)
        mujoco.mj_kinematics(robot.model, data)
        steps.show(data, np.zeros(2), 1.0 / 30.0, visible=True)
    assert len(page.prints) == 2  # one of each foot, and none of the foot in the air
    assert sorted(mark.visible for mark in steps.marks) == [False, True]
    steps.show(data, np.zeros(2), 1.0 / 30.0, visible=False)
    assert not any(mark.visible for mark in steps.marks)


def test_the_target_pose_is_sent_when_it_is_first_looked_at():
    xml = '<mujoco><worldbody><body><freejoint/><geom type="box" size=".1 .2 .3"/></body></worldbody></mujoco>'
    page: Any = Floor()
    target = TargetPose(page, lambda: mujoco.MjModel.from_xml_string(xml), 1.0)
    target.show(np.array([3.0, 2.0, 1.0, 1.0, 0.0, 0.0, 0.0]), np.zeros(2), visible=False)
    assert not page.solids
    target.show(np.array([3.0, 2.0, 1.0, 1.0, 0.0, 0.0, 0.0]), np.array([1.0, 1.0]), visible=True)
    (solid,) = (solid for name, solid in page.solids.items() if "robot" in name)
    assert 0.0 < solid.opacity < 1.0
    assert solid.batched_positions == pytest.approx(np.array([[2.0, 1.0, 1.0]]))
    target.show(np.zeros(7), np.zeros(2), visible=False)
    assert not any(solid.visible for solid in page.solids.values())


def test_a_model_is_drawn_where_it_is_with_its_shadow_and_can_be_hidden():
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><freejoint/><geom type="box" size=".1 .2 .3"/></body></worldbody></mujoco>'
    )
    page: Any = Floor()
    drawn = DrawnModel(page, model, 1.0)
    assert len(page.solids) == 2
    robot, shadow = (next(solid for name, solid in page.solids.items() if look in name) for look in ("robot", "shadow"))
    assert shadow.scale[2] < 0.01 * robot.scale[2]
    drawn.set_visible(False)
    assert not any(solid.visible for solid in (robot, shadow))
    drawn.show(np.array([3.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0]), np.array([1.0, 1.0]))
    for solid in (robot, shadow):
        assert solid.visible
        assert solid.batched_positions == pytest.approx(np.array([[2.0, 1.0, 1.0]]))
        assert np.abs(solid.batched_wxyzs) == pytest.approx(np.array([[0.0, 0.0, 0.0, 1.0]]))


def test_a_model_is_sent_as_often_as_it_moves():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    page: Any = Floor()
    drawn = DrawnModel(page, robot.model, 0.4)
    places, centre = robot.model.qpos0.copy(), np.array([0.1, 0.0])
    for _ in range(3):
        drawn.show(places, centre)
    assert len(page.moved) == len(page.solids)  # once each: solids and shadows
    places[2] += 0.01
    drawn.show(places, centre)
    assert len(page.moved) == 2 * len(page.solids)


def test_each_solid_of_a_model_is_drawn_where_its_geoms_are():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    page: Any = Floor()
    drawn = DrawnModel(page, robot.model, 0.4)
    qpos = robot.model.qpos0 + np.linspace(0.1, 0.3, robot.model.nq)
    qpos[3:7] = 0.5
    drawn.show(qpos, np.zeros(2))
    data = mujoco.MjData(robot.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(robot.model, data)
    for shape, batch in batches(robot.model).items():
        position, turn = poses(robot.model, data, batch.geom, batch.offset)
        assert page.solids[f"/robot/{shape}"].batched_positions == pytest.approx(position, abs=1e-6)
        assert page.solids[f"/shadow/{shape}"].batched_wxyzs == pytest.approx(turn, abs=1e-6)
