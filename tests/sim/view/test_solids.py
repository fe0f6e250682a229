import mujoco
import numpy as np

from sim.models.mannequin.mannequin import build_mannequin
from sim.view.solids import batches, box, cylinder, poses, sphere
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


def test_a_capsule_is_a_cylinder_between_two_spheres():
    model, data, found = figure()
    ends = np.concatenate([poses(model, data, found[shape])[0] for shape in found if "sphere" in shape])
    # The body lies along x, so the ends of the capsule do.
    assert any(np.allclose(end, [1.4, 0, 0]) for end in ends)
    assert any(np.allclose(end, [0.6, 0, 0]) for end in ends)
    assert len(found["cylinder"].geom) == 2
    assert found["cylinder"].colour[0].tolist() == [255, 0, 0]


def test_floors_hidden_groups_and_the_invisible_are_left_out():
    _, _, found = figure()
    assert sum(len(batch.geom) for batch in found.values()) == 2 + 1 + 1 + 1 + 1


def test_a_box_stands_where_its_geom_does():
    model, data, found = figure()
    position, orientation = poses(model, data, found["box"])
    assert np.allclose(position[0], [2.0, 0.0, 0.0])
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, orientation[0])
    assert np.allclose(matrix, data.geom_xmat[found["box"].geom[0]])


def test_a_mannequin_is_a_few_batches():
    found = batches(build_mannequin(human()).compile())
    assert len(found) <= 4
    assert sum(len(batch.geom) for batch in found.values()) > 60
