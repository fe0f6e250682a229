"""Layers and live values over a minute: joints that have none are played as without them, bit for bit."""

from pathlib import Path

import numpy as np
import pytest

from controller.deck.deck import Deck
from controller.deck.layers import Layers
from controller.learning.fit import fit
from controller.learning.recipe import gesture_recipe
from controller.motion.encodings.joint_angles import JointRetargeter
from hardware.rig.rig_file import load_rig
from motiondeck.run.robots.rig_on_deck import robot_of
from motiondeck_base.shipped import find_robot
from shipped_libraries import shipped
from sim.models.robot_file import read_robot_file
from sim.robots.joint_groups import joint_groups
from sim.robots.rig_robot import groups_of
from sim.robots.robot import load_robot

pytestmark = [pytest.mark.thorough, pytest.mark.timeout(900)]
EXAMPLES = Path(__file__).parents[2] / "examples"
DT = 0.01
KNEEL = """
unit = "rad"
plays = "loop"
length = 2.0
[[key]]
at = 0.0
pose = { %s }
[[key]]
at = 1.0
pose = { %s }
"""


def on_servo20(folder):
    library, file = shipped(), find_robot("servo20")
    robot = load_robot(file, library.skeleton, None, DT)
    groups = joint_groups(robot, read_robot_file(file), library.skeleton)
    return library, robot.joints, robot.limits, groups, robot.twin, ("walk", "waltz", "jog"), ("arms", "head")


def on_a_rig(name, files, layered):
    def made(folder):
        file = EXAMPLES / name / f"{name}.toml"
        joints = load_rig(file).names
        low, high = (", ".join(f"{joint} = {value}" for joint in joints) for value in (0.05, 0.15))
        (folder / "kneel.toml").write_text(KNEEL % (low, high))
        library = fit(gesture_recipe(name, [*(EXAMPLES / name / one for one in files), folder / "kneel.toml"]), folder)
        groups = groups_of(joints) | load_rig(file).groups
        limits = robot_of(file, library.skeleton).limits
        motions = tuple(motion.name for motion in library.info.motions)

        def twin():
            return JointRetargeter(library.skeleton, joints, np.zeros(len(joints)))

        return library, joints, limits, groups, twin, motions, layered

    return made


STAGES = {
    "servo20": on_servo20,
    "hexapod": on_a_rig("hexapod", ["tripod.toml"], ("left", "right_front_tibia")),
    "head": on_a_rig("head", ["idle.toml", "talk.toml"], ("face", "jaw")),
}


@pytest.mark.parametrize("stage", STAGES)
def test_joints_outside_layers_are_the_same_bit_for_bit_over_a_minute(stage, tmp_path):
    library, joints, limits, groups, twin, motions, layered = STAGES[stage](tmp_path)
    touched = sorted({joints.index(one) for name in layered for one in groups.get(name, (name,))})
    others = np.setdiff1d(np.arange(len(joints)), touched)
    assert 0 < len(touched) < len(joints)
    deck, plain = (Deck(library, twin(), motions[0]) for _ in range(2))
    deck.layers = Layers(library, joints, limits, groups, twin)
    rng, apart = np.random.default_rng(4), 0
    for tick in range(6000):
        if tick % 300 == 100:
            motion = motions[rng.integers(len(motions))]
            deck.switch(motion), plain.switch(motion)
        if tick % 170 == 0:
            weight, tempo = rng.uniform(0.3, 1.0), rng.uniform(0.5, 1.5)
            deck.layer(layered[rng.integers(len(layered))], motions[rng.integers(len(motions))], weight, tempo)
        if tick % 900 == 800:
            deck.layer("off", "off")
        if tick % 2 == 0 and tick % 1000 > 600:
            deck.set_input(layered[-1], 0.5 * np.sin(0.05 * tick))
        targets, alone = deck.update(DT)[0], plain.update(DT)[0]
        assert np.array_equal(targets[others], alone[others]), tick
        apart += not np.array_equal(targets[touched], alone[touched])
    assert apart > 4000
