"""Tests of finding the feet of a robot: the body with the sole, whatever hangs above and below it."""

import mujoco
import numpy as np
import pytest

from sim.models.feet import find_feet

ANKLE = '<geom type="box" size=".02 .02 .02"/>'
SOLE = '<geom type="box" size=".1 .04 .01" pos=".03 0 -.04"/>'
# As broad and long, with the bulk over the heel: the axes of its mass are tilted, its lower side is level.
SHOE = '<geom type="mesh" mesh="shoe" pos=".03 0 -.05"/>'
BULK = (
    "-.1 -.04 0 -.1 .04 0 .1 -.04 0 .1 .04 0 -.1 -.04 .06 -.1 .04 .06 -.03 -.04 .06 -.03 .04 .06 .1 -.04 .01 .1 .04 .01"
)
# Three rods side by side, as some files have soles, below a shoe that is only seen.
RODS = '<geom type="mesh" mesh="shoe" pos=".03 0 -.05" contype="0" conaffinity="0"/>' + "".join(
    f'<geom type="capsule" size=".01" fromto="-.06 {y} -.04 .12 {y} -.04"/>' for y in (-0.03, 0.0, 0.03)
)
# An ankle that reaches the ground itself, and a link that is a frame and no more.
LOW, NOTHING = (
    '<geom type="box" size=".02 .02 .045"/>',
    '<inertial pos="0 0 0" mass=".01" diaginertia="1e-5 1e-5 1e-5"/>',
)
TOES = '<geom type="box" size=".02 .04 .01" pos=".15 0 -.04"/>'


def robot(*links):
    """Two legs of a trunk that end in links, each hanging from the one before."""
    legs = ""
    for side, y in (("l", 0.1), ("r", -0.1)):
        chain = ""
        for name, geom in reversed(links):
            chain = f'<body name="{side}_{name}"><joint name="{side}_{name}" axis="0 1 0"/>{geom}{chain}</body>'
        legs += f'<body name="{side}_shank" pos="0 {y} -.45"><geom type="capsule" size=".03" fromto="0 0 .4 0 0 .1"/>'
        legs += f"{chain}</body>"
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="shoe" vertex="{BULK}"/></asset>'
        '<worldbody><body name="trunk" pos="0 0 .5"><freejoint/><geom type="box" size=".1 .15 .3"/>'
        f"{legs}</body></worldbody></mujoco>"
    )


@pytest.mark.parametrize(
    ("links", "foot"),
    [
        ([("foot", SOLE)], "foot"),
        ([("pitch", ANKLE), ("roll", SOLE)], "roll"),
        ([("foot", SOLE), ("toes", TOES)], "foot"),
        ([("pitch", ANKLE), ("roll", SOLE), ("toes", TOES)], "roll"),
        ([("pitch", LOW), ("frame", NOTHING), ("roll", SOLE)], "roll"),
    ],
)
def test_the_foot_is_the_body_with_the_largest_sole(links, foot):
    model = robot(*links)
    feet = find_feet(model, model.qpos0)
    assert {found.body for found in feet} == {f"l_{foot}", f"r_{foot}"}
    for found in feet:
        assert found.area == pytest.approx(0.2 * 0.08)


@pytest.mark.parametrize("sole", [SOLE, SHOE, RODS], ids=["box", "mesh", "rods"])
def test_a_sole_is_the_flat_side_that_looks_down(sole):
    model = robot(("foot", sole))
    for foot in find_feet(model, model.qpos0):
        assert foot.axes == pytest.approx(np.eye(3), abs=2e-3)
        assert foot.sole == pytest.approx([0.03, 0.0, -0.05], abs=1e-3)
        assert foot.area == pytest.approx(0.2 * 0.08, rel=0.02)
        assert foot.round == (sole is RODS)
