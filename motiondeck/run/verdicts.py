"""The table of verdicts on a library's motions on a robot: made once, and kept beside the robot file.

A kept verdict counts as long as nothing that it depends on has changed: the library, the robot with its model and
meshes, the rig, the root, the tempo, and the code that judges. A file that cannot be read is made anew.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from motiondeck_base.files import keep, read_kept
from motiondeck_base.shipped import find_library, find_rig, shipped_configs, user_cache
from sim.robots.verdict import RobotVerdict

if TYPE_CHECKING:
    from controller.deck.interfaces import JointLimits
    from controller.library.motion_library import MotionLibrary
    from motiondeck_base.jobs import Jobs
    from sim.physics.preflight.preflight import Preflight
    from sim.robots.robot import Robot

PER_PROCESS = 4  # motions that are worth the seconds in which another process loads library and robot
KEPT = 16  # tables of one robot, the latest

Tables = dict[str, dict[str, list[RobotVerdict]]]
"""By the digest of all that they depend on, the verdicts on "walk", and on the switches from it, "walk >"."""


@dataclass(frozen=True)
class Judged:
    """A library on a robot with a root, perhaps with a rig, at a tempo."""

    library: Path
    robot: Path
    rig: Path | None = None  # its limits of position, velocity and current apply too
    root: str = "gantry"
    balance: bool = False  # whether a free robot keeps its balance
    walk: bool = False  # whether a free robot walks
    tempo: float = 1.0

    @classmethod
    def of(cls, library: str | Path, robot: str | Path, rig: str | Path | None = None, **settings: Any) -> Judged:
        """The same by names of library, robot and rig; MotiondeckError if there is none of a name."""
        from sim.robots.catalogue import find_robot

        return cls(find_library(library), find_robot(robot), find_rig(rig) if rig is not None else None, **settings)

    def motions(self, names: Sequence[str], jobs: Jobs | None = None) -> Iterator[RobotVerdict]:
        """Verdicts on motions, in order, each as soon as it is known and kept; they are played in physics too."""
        from joblib import cpu_count, delayed

        from motiondeck_base.jobs import Jobs, spread

        known = self._tables.get(self._key, {})
        new = [name for name in names if name not in known]
        where = jobs or Jobs(max(1, min(cpu_count(), len(new) // PER_PROCESS)))
        made = spread((delayed(_judge)(self, name) for name in new), where)
        for name in names:
            if name not in known:
                known[name] = next(made)
                tables = self._tables
                mine = tables.pop(self._key, {}) | {name: known[name]}
                keep(self._file, msgspec.json.encode(dict([*tables.items()][1 - KEPT :]) | {self._key: mine}))
            yield from known[name]

    def switches(self, names: Sequence[str], jobs: Jobs | None = None) -> Iterator[RobotVerdict]:
        """Verdicts on the direct switches from motions, in order, each as soon as it is known and kept."""
        return self.motions([f"{name} >" for name in names], jobs)

    def kept(self) -> dict[str, RobotVerdict]:
        """The verdicts on motions that have been made, by motion."""
        known = self._tables.get(self._key, {}) if self._file.exists() else {}
        return {row: verdicts[0] for row, verdicts in known.items() if not row.endswith(">")}

    @property
    def _file(self) -> Path:
        folder = self.robot.parent
        if folder.resolve() == (shipped_configs() / "robots").resolve() or not os.access(folder, os.W_OK):
            folder = user_cache() / "verdicts"
        return folder / f"{self.robot.stem}.verdicts.json"

    @property
    def _tables(self) -> Tables:
        return read_kept(self._file, Tables) or {}

    @cached_property
    def _key(self) -> str:
        from sim.robots.robot_digest import code_digest, robot_digest

        code = code_digest(Path(__file__), Path(__file__).with_name("sampled_motions.py"))
        settings = robot_digest(self.robot), self.root, self.balance, self.walk, self.tempo
        digest = hashlib.sha256(repr(settings).encode() + code)
        for file in (self.library, self.rig):
            digest.update(hashlib.sha256(file.read_bytes() if file is not None else b"").digest())
        return digest.hexdigest()


def _judge(judged: Judged, row: str) -> list[RobotVerdict]:
    """The verdict on a motion, which is played in physics too, or those on the direct switches from it."""
    from motiondeck.run.sampled_motions import play_motions, play_switches

    library, judge = loaded(judged)
    name = row.removesuffix(" >")
    play, simulate = (play_motions, True) if name == row else (play_switches, False)
    played = play(library, judge.robot, [name])
    return [judge.judge(one, simulate=simulate, tempo=judged.tempo) for one in played]


@lru_cache(maxsize=1)
def loaded(judged: Judged) -> tuple[MotionLibrary, Preflight]:
    """The library, and the judge of its motions on the robot; raises a MotiondeckError if a file cannot be used."""
    from controller.library.motion_library import load_library
    from controller.loop.safety.safety_envelope import SafetyEnvelope
    from motiondeck.run.robots.walk_choice import able_to_walk
    from sim.models.robot_file import read_robot_file
    from sim.physics.played_motions import DT
    from sim.physics.preflight.preflight import Preflight
    from sim.physics.preflight.static_checks import CarriedChecks
    from sim.robots.robot import load_robot

    library, file = load_library(judged.library), read_robot_file(judged.robot)
    body, limits = on_rig(load_robot(judged.robot, library.skeleton, dt=DT), judged.rig)
    if judged.walk:
        body = able_to_walk(body, judged.robot)
    carried = None
    if file.parts and not library.skeleton.is_rig:
        carried = CarriedChecks(body, file.parts, file.root_rotation, library.skeleton)
    return library, Preflight(body, limits, SafetyEnvelope, judged.root, judged.balance, judged.walk, carried)


def on_rig(body: Robot, rig: Path | None) -> tuple[Robot, JointLimits]:
    """The robot with the servos of a rig, and the limits that both allow."""
    if rig is None:
        return body, body.limits
    from hardware.rig.rig_file import load_rig
    from motiondeck.run.robots.rig_output import narrowed

    config = load_rig(rig)
    servo = body.servo
    if servo is not None:
        currents = [joint.current for joint in config.joints if joint.current > 0.0]
        servo = msgspec.structs.replace(
            servo,
            current_limit=min([*currents, servo.current_limit or servo.current]),
            hottest=min(servo.hottest, *(joint.hottest for joint in config.joints)),
        )
    elif any(joint.current > 0.0 for joint in config.joints):
        print(
            f"the rig's current limits are not applied: the file of {body.name} has no table [servo] with the torque "
            "of a current",
            file=sys.stderr,
        )
    return replace(body, servo=servo), narrowed(body.limits, body, config)
