"""Errors and time of retargeting beside plain mink.

Walk, jog, waltz and box as the shipped library plays them, at 120 Hz. First servo20 with either solver; then a humanoid
of 57 hinges and a free root, made here from the motions' own skeleton so that every pose is in reach, by ours and by
mink set up as its examples do (frame tasks, posture, configuration and velocity limits, DAQP, one step a frame; needs
pip install mink). Angles between the robot's limbs and the human's in the world are
means in degrees; errors of the second robot are of knees and ankles seen from the hip, elbows and wrists seen from the
shoulder, in mm. Times are medians over rounds of 40 frames.
"""

# pyright: reportMissingImports=false
# (mink need not be installed.)

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

# One thread each, for theirs as for ours; it must be said before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import mujoco
import numpy as np
import typer

from benchmarks import command
from controller.library.motion_library import load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.clip import Clip
from controller.motion.rotations import Array
from controller.motion.skeleton import ROOT, Pose, Skeleton
from motiondeck.run.sampled_motions import as_clip
from motiondeck_base.shipped import find_library, find_robot
from sim.models.robot_file import read_robot_file
from sim.retargeting.limb_finder import SIDES
from sim.robots.fidelity import carry, floor_measures, joint_measures
from sim.robots.limb_directions import LimbDirections
from sim.robots.robot import Robot, load_robot

MOTIONS = ("walk", "jog", "waltz", "box1")
RATE, SECONDS, ROUND = 120.0, 4.0, 40
# The bodies that begin at knees, ankles, elbows, wrists, neck and shoulders, each named as the bone that it carries.
POINTS = ("rank", "rfoo", "lank", "lfoo", "rwri", "rhan", "lwri", "lhan", "head", "relb", "lelb")
SEEN_FROM = {"rank": "rkne", "rfoo": "rkne", "lank": "lkne", "lfoo": "lkne"}
SEEN_FROM |= {"rwri": "relb", "rhan": "relb", "lwri": "lelb", "lhan": "lelb"}
PARTS = {
    "pelvis": "(root)",
    "chest": "neck",
    "head": "head",
    **{
        f"{side}_{part}": f"{side}{bone}"
        for side in SIDES
        for part, bone in {
            "thigh": "kne",
            "shank": "ank",
            "foot": "foo",
            "upper_arm": "elb",
            "forearm": "wri",
            "hand": "han",
        }.items()
    },
}


def main(
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON object a line.")] = False,
) -> None:
    library = load_library(find_library("thesis15"))
    clips = [as_clip(library, name, SECONDS, RATE) for name in MOTIONS]
    rows = [measured(find_robot("servo20"), clips, solver) for solver in ("angles", "ik")]
    with tempfile.TemporaryDirectory() as folder:
        rows += big(Path(folder), clips)
    for row in rows:
        print(json.dumps(row) if as_json else said(row))


def measured(path: Path, clips: list[Clip], solver) -> dict[str, object]:
    """One row for a robot file: errors and times over all clips."""
    file = read_robot_file(path)
    joints, errors, zeros, slides, paths, times = 0, [], np.zeros(3), [], [], []
    for clip in clips:
        robot = load_robot(path, clip.skeleton, solver, 1.0 / clip.rate)
        joints = len(robot.joints)
        carried = carry(clip, robot, SafetyEnvelope)
        directions = LimbDirections(robot.model, file.parts, np.array(file.root_rotation))
        degrees = directions.degrees(carried.qpos, carried.limbs).mean(axis=0).tolist()
        errors.append(dict(zip((s.name for s in directions.segments), degrees, strict=True)))
        counts = joint_measures(clip, robot, carried)
        zeros += [counts["beyond"], counts["too_fast"], counts["jumps"]]
        slides.append(floor_measures(clip, robot, carried.qpos, file.parts)["slide"])
        plain = scaled_path(clip, robot, carried.qpos)
        paths.append(floor_measures(clip, robot, plain, file.parts)["slide"])
        times += rounds(robot.retarget, clip)
    return {
        "robot": file.name,
        "solver": solver,
        "joints": joints,
        "microseconds": float(np.median(times)),
        **{
            f"{part}_deg": float(np.mean([error[f"{side}_{part}"] for error in errors for side in SIDES]))
            for part in ("thigh", "shank", "upper_arm", "forearm")
        },
        "beyond_limits": int(zeros[0]),
        "too_fast": int(zeros[1]),
        "jumps": int(zeros[2]),
        "slide_mm_s": 1000.0 * float(np.mean(slides)),
        "slide_on_the_scaled_path_mm_s": 1000.0 * float(np.mean(paths)),
    }


def rounds(retarget: Callable[[Pose], Array], clip: Clip) -> list[float]:
    """Microseconds a frame, one figure a round."""
    poses = [Pose(clip.root_position[t], np.zeros(()), clip.rotation[t]) for t in range(len(clip))]
    times = []
    for first in range(0, len(poses) - ROUND + 1, ROUND):
        start = time.perf_counter()
        for pose in poses[first : first + ROUND]:
            retarget(pose)
        times.append(1e6 * (time.perf_counter() - start) / ROUND)
    return times


def big(folder: Path, clips: list[Clip]) -> list[dict[str, object]]:
    """A humanoid with three hinges a bone, by our inverse kinematics and by mink: the same poses, the same points."""
    skeleton = clips[0].skeleton
    spec = hinged(skeleton)
    spec.compile()
    spec.to_file(str(folder / "hinged.xml"))
    parts = "\n".join(f'{part} = "{body}"' for part, body in PARTS.items())
    path = folder / "hinged.toml"
    path.write_text(
        'name = "hinged"\nkind = "humanoid"\nmodel = "hinged.xml"\nsolver = "ik"\n'
        f"root_height = {skeleton.leg_length}\n[limits]\nvelocity = 30.0\nacceleration = 3000.0\njerk = 300000.0\n"
        f"[parts]\n{parts}\n"
    )
    robot = load_robot(path, skeleton, dt=1.0 / RATE)
    rows = [compared("ours", robot, clips, robot.retarget)]
    try:
        rows.append(compared("mink", robot, clips, Mink(robot, skeleton)))
    except ImportError:
        print("mink is not installed: pip install mink", file=sys.stderr)
    return rows


def compared(name: str, robot: Robot, clips: list[Clip], retarget) -> dict[str, object]:
    data, miss, speeds, times = mujoco.MjData(robot.model), [], [], []
    bodies = [[robot.model.body(name).id for name in names] for names in (SEEN_FROM, SEEN_FROM.values())]
    for clip in clips:
        starts = [
            [1 + int(clip.skeleton.parent[clip.skeleton.index(point)]) for point in names]
            for names in (SEEN_FROM, SEEN_FROM.values())
        ]
        wanted = clip.joints()[:, starts[0]] - clip.joints()[:, starts[1]]
        retarget.reset()
        before = None
        for frame in range(len(clip)):
            pose = Pose(clip.root_position[frame], np.zeros(()), clip.rotation[frame])
            targets = np.array(retarget(pose))
            robot.place(targets, pose, data.qpos)
            if retarget is not robot.retarget:  # ours turns its pelvis itself
                data.qpos[:3], data.qpos[3:7] = pose.root_position, pose.rotation[0]
            mujoco.mj_kinematics(robot.model, data)
            there = data.xpos[bodies[0]] - data.xpos[bodies[1]]
            miss.append(np.linalg.norm(there - wanted[frame], axis=1))
            if before is not None:
                speeds.append(np.abs(targets - before).max() * clip.rate)
            before = targets
        times += rounds(retarget, clip)
    return {
        "robot": f"hinged, {robot.model.nv} degrees of freedom",
        "solver": name,
        "joints": len(robot.joints),
        "microseconds": float(np.median(times)),
        "joints_mm": 1000.0 * float(np.sqrt(np.mean(np.square(miss)))),
        "joints_worst_mm": 1000.0 * float(np.max(miss)),
        "fastest_joint_rad_s": float(np.max(speeds)),
    }


class Mink:
    """Plain mink on the same model: a frame task a point, the pelvis, a posture, limits; one step a frame."""

    def __init__(self, robot: Robot, skeleton: Skeleton) -> None:
        import mink

        self._mink, self._robot, self._skeleton = mink, robot, skeleton
        self._configuration = mink.Configuration(robot.model)
        self._points = [
            mink.FrameTask(p, "body", position_cost=1.0, orientation_cost=0.0, lm_damping=1e-3) for p in POINTS
        ]
        self._pelvis = mink.FrameTask("(root)", "body", position_cost=10.0, orientation_cost=10.0, lm_damping=1e-3)
        self._posture = mink.PostureTask(robot.model, cost=1e-2)
        speeds = dict.fromkeys(robot.joints, 30.0)
        self._limits = [mink.ConfigurationLimit(robot.model), mink.VelocityLimit(robot.model, speeds)]
        self._ends = [1 + int(skeleton.parent[skeleton.index(point)]) for point in POINTS]
        self._started = False
        self._posture.set_target(robot.model.qpos0)

    def reset(self) -> None:
        """Starts anew."""
        self._started = False

    def __call__(self, pose: Pose) -> Array:
        """The joint positions (J,), rad."""
        mink, configuration = self._mink, self._configuration
        joints = self._skeleton.joints(pose.root_position, pose.rotation)
        for task, end in zip(self._points, self._ends, strict=True):
            task.set_target(mink.SE3.from_translation(joints[end]))
        self._pelvis.set_target(mink.SE3.from_rotation_and_translation(mink.SO3(pose.rotation[0]), pose.root_position))
        steps = 1
        if not self._started:
            self._started, steps = True, 100
            start = self._robot.model.qpos0.copy()
            start[:3], start[3:7] = pose.root_position, pose.rotation[0]
            configuration.update(start)
        for _ in range(steps):
            velocity = mink.solve_ik(
                configuration, [*self._points, self._pelvis, self._posture], 1.0 / RATE, "daqp", limits=self._limits
            )
            configuration.integrate_inplace(velocity, 1.0 / RATE)
        return configuration.q[self._robot.layout.hinge_qpos]


def hinged(skeleton: Skeleton) -> mujoco.MjSpec:
    """A humanoid with three hinges a bone, in the rest pose of the skeleton."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    root = spec.worldbody.add_body(name="(root)", pos=[0.0, 0.0, skeleton.leg_length])
    root.add_freejoint(name="(root)")
    root.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.08, 0.0, 0.0], mass=8.0)
    bodies = {ROOT: root}
    for bone, name in enumerate(skeleton.bones):
        parent = int(skeleton.parent[bone])
        start = np.zeros(3) if parent == ROOT else skeleton.rest_direction[parent] * skeleton.length[parent]
        body = bodies[parent].add_body(name=name, pos=start)
        # A pelvis hardly gives.
        reach = 0.05 if name.endswith("hip") else 2.9
        for axis in range(3):
            body.add_joint(name=f"{name}.{'zyx'[axis]}", axis=np.eye(3)[2 - axis], limited=True, range=[-reach, reach])
        end = skeleton.rest_direction[bone] * max(float(skeleton.length[bone]), 0.02)
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[0.0, 0.0, 0.0, *end], size=[0.03, 0.0, 0.0], mass=2.0)
        bodies[bone] = body
    return spec


def scaled_path(clip: Clip, robot: Robot, qpos: Array) -> Array:
    """The same joints with the root on the human's own path, to scale: what footing is compared with, shape (T, nq)."""
    plain = qpos.copy()
    plain[:, :3] = robot.path_scale * clip.root_position
    return plain


def said(row: dict[str, object]) -> str:
    figures = (f"{key} {value:.1f}" if isinstance(value, float) else f"{key} {value}" for key, value in row.items())
    return ", ".join(figures)


if __name__ == "__main__":
    command.run("retarget", main, __doc__)
