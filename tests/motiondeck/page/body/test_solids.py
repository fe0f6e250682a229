import mujoco
import numpy as np

from controller.motion.rotations import rotate
from motiondeck.page.body.solids import batches, box, cap, cylinder, mantle, poses, sphere
from sim.models.mannequin.mannequin import build_mannequin
from simulated_bodies import human

XML = """
<mujoco><worldbody>
  <geom type="plane" size="1 1 1"/>
  <body pos="1 0 0" euler="0 90 0">
    <geom type="capsule" size="0.1 0.4" rgba="1 0 0 1"/>
    <geom type="box" size="0.1 0.2 0.3" pos="0 0 1"/>
    <geom type="cylinder" size="0.1 0.2"/>
    <geom type="ellipsoid" size="0.1 0.5 0.3"/>
    <geom type="sphere" size="0.1" group="4"/>
    <geom type="sphere" size="0.1" rgba="1 1 1 0"/>
  </body>
</worldbody></mujoco>
"""


def figure():
    model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data, batches(model)


def outward(mesh):
    """Whether every triangle of a convex mesh about the origin shows its front to the outside."""
    corners = mesh[0][mesh[1]].astype(float)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.sum(normal * corners.mean(axis=1), axis=1)
    return np.all(facing[np.linalg.norm(normal, axis=1) > 1e-9] > 0.0)


def test_solids_are_closed_and_face_outwards():
    for mesh in (sphere(8, 12), cylinder(12), box()):
        assert outward(mesh)
        assert np.allclose(np.abs(mesh[0]).max(axis=0), 1.0, atol=0.05)


def placed(model, data, batch):
    return poses(model, data, batch.geom, batch.offset)


def test_the_parts_of_a_capsule_face_outwards():
    for part in (cap(1.0, 3, 16), cap(-1.0, 3, 16), mantle(16)):
        assert outward(part)
    assert cap(1.0, 3, 16)[0][:, 2].max() == 1.0
    assert cap(-1.0, 3, 16)[0][:, 2].min() == -1.0


def test_a_capsule_is_a_mantle_between_two_caps():
    model, data, found = figure()
    # The body lies along x, so the ends of the capsule do.
    (up, way), (down, _) = (placed(model, data, found[shape]) for shape in ("cap up", "cap down"))
    assert np.allclose(up, [[1.4, 0, 0]])
    assert np.allclose(down, [[0.6, 0, 0]])
    # Each cap reaches farthest where the capsule ends.
    for end, shape, sign in ((up, "cap up", 1.0), (down, "cap down", -1.0)):
        corners = end[0] + rotate(way[0], found[shape].scale[0] * found[shape].mesh[0].astype(float))
        assert np.isclose((sign * corners[:, 0]).max(), sign * (1.0 + sign * 0.5))
    assert len(found["mantle"].geom) == len(found["cylinder"].geom) == 1
    assert found["mantle"].colour[0].tolist() == [255, 0, 0]


def test_a_shadow_has_fewer_triangles_and_the_same_size():
    for shape, batch in figure()[2].items():
        assert len(batch.shadow[1]) < len(batch.mesh[1]) or shape == "box"
        assert np.allclose(np.ptp(batch.shadow[0], axis=0), np.ptp(batch.mesh[0], axis=0), rtol=0.08)


def test_floors_hidden_groups_and_the_invisible_are_left_out():
    _, _, found = figure()
    assert sum(len(batch.geom) for batch in found.values()) == 2 + 1 + 1 + 1 + 1


def test_a_box_stands_where_its_geom_does():
    model, data, found = figure()
    position, orientation = placed(model, data, found["box"])
    assert np.allclose(position[0], [2.0, 0.0, 0.0])
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, orientation[0])
    assert np.allclose(matrix, data.geom_xmat[found["box"].geom[0]])


def test_a_mannequin_is_a_few_batches():
    found = batches(build_mannequin(human()).compile())
    assert len(found) <= 4
    assert sum(len(batch.geom) * len(batch.mesh[1]) for batch in found.values()) < 16_000
    assert sum(len(batch.geom) for batch in found.values()) > 60
