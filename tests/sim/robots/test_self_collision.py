"""Which bodies are never asked whether they overlap."""

import mujoco

from sim.models.overlaps import near_bodies

# An arm of three links, another of one, and a box around the hand of the first.
BODIES = """<mujoco><worldbody>
  <body name="trunk"><geom size=".1"/>
    <body name="upper" pos="0 1 0"><joint/><geom size=".1"/>
      <body name="fore" pos="0 1 0"><joint/><geom size=".1"/>
        <body name="hand" pos="0 1 0"><joint/><geom size=".1"/></body>
      </body>
    </body>
    <body name="other" pos="0 -1 0"><joint/><geom size=".1"/></body>
  </body>
  <body name="box" pos="0 3 .05"><freejoint/><geom size=".1"/></body>
</worldbody></mujoco>"""


def test_near_are_two_joints_apart_brothers_and_what_overlaps_at_rest():
    model = mujoco.MjModel.from_xml_string(BODIES)
    near = {" ".join(sorted((model.body(a).name, model.body(b).name))) for a, b in near_bodies(model, model.qpos0)}
    assert near == {
        *("trunk upper", "fore trunk", "fore upper", "hand upper", "fore hand", "other trunk", "other upper"),
        *("box trunk", "box hand"),
    }
    moved = model.qpos0.copy()
    moved[model.joint(model.body("box").jntadr[0]).qposadr[0] + 2] = 1.0
    assert near_bodies(model, moved) == {pair for pair in near_bodies(model, model.qpos0) if pair != (4, 6)}
