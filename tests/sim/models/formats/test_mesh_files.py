"""Tests of meshes that MuJoCo does not read: what is in the file is where the robot is."""

import mujoco
import numpy as np
import pytest

from motiondeck_base.errors import FileFormatError
from sim.models.formats.mesh_files import read_collada, read_triangles
from sim.models.formats.urdf_visuals import with_visuals
from sim.models.model_file import read_model
from sim.models.surface import LowestPoint
from small_robots import calibrated, humanoid, urdf

CORNERS = [(x, y, z) for x in (-0.03, 0.11) for y in (-0.03, 0.03) for z in (-0.04, -0.02)]
# Each side of the box, seen from outside.
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
BOX = '<geometry><box size="0.14 0.06 0.02"/></geometry><origin xyz="0.04 0 -0.03"/>'


def collada(corners=CORNERS, node="", metre=1.0, up="Z_UP", polygons="polylist"):
    points = " ".join(f"{value / metre:.9g}" for corner in corners for value in corner)
    if polygons == "triangles":
        faces = [f"{corner} 7" for a, b, c, d in SIDES for corner in (a, b, c, a, c, d)]
        listed = f"<p>{' '.join(faces)}</p>"
    else:
        listed = f"<vcount>{'4 ' * len(SIDES)}</vcount><p>{' '.join(f'{c} 7' for side in SIDES for c in side)}</p>"
    axes = "".join(f'<param name="{axis}" type="float"/>' for axis in "XYZ")
    return f"""<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
      <asset><unit name="own" meter="{metre}"/><up_axis>{up}</up_axis></asset>
      <library_geometries><geometry id="g"><mesh><source id="s"><float_array id="a" count="24">{points}</float_array>
        <technique_common><accessor source="#a" count="8" stride="3">{axes}</accessor></technique_common></source>
        <source id="n"><float_array id="b" count="24">{points}</float_array>
        <technique_common><accessor source="#b" count="8" stride="3">{axes}</accessor></technique_common></source>
        <vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
        <{polygons} count="6"><input semantic="VERTEX" source="#v" offset="0"/>
          <input semantic="NORMAL" source="#n" offset="1"/>{listed}</{polygons}></mesh></geometry></library_geometries>
      <library_visual_scenes><visual_scene id="w"><node>{node}<node><instance_geometry url="#g"/></node></node>
      </visual_scene></library_visual_scenes></COLLADA>"""


def stl_text():
    facets = [
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in (CORNERS[k] for k in three))
        + "endloop\nendfacet\n"
        for a, b, c, d in SIDES
        for three in ((a, b, c), (a, c, d))
    ]
    return f"solid box\n{''.join(facets)}endsolid box\n"


def legs(folder, name, content):
    """Two legs whose soles are a mesh file beside them."""
    (folder / "meshes").mkdir()
    (folder / "meshes" / name).write_text(content)
    path = folder / "legs.urdf"
    mesh = BOX.replace('<box size="0.14 0.06 0.02"/>', f'<mesh filename="meshes/{name}"/>').replace(
        "0.04 0 -0.03", "0 0 0"
    )
    path.write_text(urdf().replace(BOX, mesh))
    return path


def lowest(model):
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return LowestPoint(model)(data)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("sole.dae", collada()),
        ("sole.DAE", collada(metre=0.001, polygons="triangles")),
        ("sole.stl", stl_text()),
    ],
)
def test_a_robot_whose_meshes_mujoco_cannot_read_is_as_large_as_they_are(tmp_path, name, content):
    plain = tmp_path / "plain.urdf"
    plain.write_text(urdf())
    spec = read_model(legs(tmp_path, name, content))
    model, boxes = spec.compile(), read_model(plain).compile()
    assert lowest(model) == pytest.approx(lowest(boxes), abs=1e-6)
    saved = mujoco.MjSpec.from_string(spec.to_xml()).compile()  # as the page gets it
    assert lowest(saved) == pytest.approx(lowest(boxes), abs=1e-6)
    assert with_visuals(spec)[1].ngeom == model.ngeom


@pytest.mark.parametrize(
    ("node", "expected"),
    [
        ("<translate>1 2 3</translate>", (1.04, 2.0, 2.97)),
        ("<rotate>0 0 1 90</rotate><scale>2 2 2</scale>", (0.0, 0.08, -0.06)),
        ("<matrix>0 -1 0 5 1 0 0 0 0 0 1 0 0 0 0 1</matrix>", (5.0, 0.04, -0.03)),
    ],
)
def test_the_nodes_of_a_scene_move_what_is_in_them(tmp_path, node, expected):
    path = tmp_path / "box.dae"
    path.write_text(collada(node=node))
    read = read_collada(path)
    middle = 0.5 * (read.points.min(axis=0) + read.points.max(axis=0))
    assert middle == pytest.approx(np.array(expected), abs=1e-6)  # pycollada reads float32
    a, b, c = (read.points[read.faces[:, corner]] for corner in range(3))
    outwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), (a + b + c) / 3.0 - middle)
    assert len(read.faces) == 12
    assert (outwards > 0.0).all()


@pytest.mark.parametrize("turned", [True, False])
def test_a_file_with_y_up_is_turned_if_the_masses_say_so(tmp_path, turned):
    """RViz shows such files unturned, so some robots have them that way and others the other way."""
    corners = [(x, z, -y) for x, y, z in CORNERS] if turned else CORNERS
    path = legs(tmp_path, "sole.dae", collada(corners, up="Y_UP"))
    mass = '<inertial><mass value="1"/>'
    path.write_text(path.read_text().replace(mass, f'{mass}<origin xyz="0.04 0 -0.03"/>'))
    assert lowest(read_model(path).compile()) == pytest.approx(-0.44, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("sole.dae", "<COLLADA/>", "no triangle in it.*save it anew as an STL or OBJ"),
        ("sole.dae", "<!DOCTYPE a><COLLADA/>", "document type"),
        ("sole.dae", collada().replace("<p>0", "<p>99"), "Indexes .* go beyond"),
        ("sole.stl", "solid box\nendsolid", "no triangles"),
        ("sole.glb", "glTF", "unknown kind; convert it to STL, OBJ or DAE"),
    ],
)
def test_a_mesh_that_cannot_be_read_is_named_with_a_remedy(tmp_path, name, content, complaint):
    with pytest.raises(FileFormatError, match=f"{name}.*{complaint}") as error:
        read_model(legs(tmp_path, name, content))
    assert "\n" not in str(error.value)


def test_a_flat_mesh_is_a_thin_plate(tmp_path):
    path = tmp_path / "plate.dae"
    path.write_text(collada([(x, y, 0.0) for x, y, _ in CORNERS]))
    assert read_triangles(path) is not None
    model = read_model(legs(tmp_path, "sole.dae", path.read_text())).compile()
    assert lowest(model) == pytest.approx(-0.4, abs=1e-3)


@pytest.mark.parametrize("file", ["legs.urdf", "small.xml"])
def test_a_mesh_whose_name_differs_in_the_case_of_its_letters_is_found(tmp_path, file):
    if file.endswith(".urdf"):
        path = legs(tmp_path, "sole.stl", stl_text())
    else:
        path = tmp_path / file
        mesh = '<geom type="mesh" mesh="sole"/>'
        path.write_text(
            humanoid(trunk=mesh, extra='<asset><mesh name="sole" file="sole.stl"/></asset>').replace(
                "<compiler ", '<compiler meshdir="meshes" '
            )
        )
        (tmp_path / "meshes").mkdir()
        (tmp_path / "meshes" / "sole.stl").write_text(stl_text())
    expected = read_model(path).compile()
    path.write_text(path.read_text().replace("sole.stl", "Sole.STL"))
    found = read_model(path).compile()
    assert found.nmesh == expected.nmesh == 1
    assert found.mesh_vert == pytest.approx(expected.mesh_vert)


LOOK = '<geom type="mesh" mesh="hull" contype="0" conaffinity="0" group="2" pos="0.3 0 0"/>'


def test_a_missing_mesh_that_only_draws_becomes_the_box_of_its_bodys_inertia_with_a_word(tmp_path):
    path = tmp_path / "small.xml"
    inertial = '<inertial pos="0.01 0 0.1" mass="2" diaginertia="0.0166667 0.0083333 0.0216667"/>'
    text = humanoid(trunk=LOOK + inertial, extra='<asset><mesh name="hull" file="hull.stl"/></asset>')
    path.write_text(text)
    model = read_model(path).compile()
    (box,) = (geom for geom in range(model.ngeom) if model.geom_group[geom] == 2)
    assert model.geom_type[box] == mujoco.mjtGeom.mjGEOM_BOX
    assert model.geom_size[box] == pytest.approx([0.1, 0.15, 0.05], abs=1e-3)
    assert model.geom_pos[box] == pytest.approx([0.01, 0.0, 0.1])
    assert not model.geom_contype[box]
    (said,) = (doubt for doubt in calibrated(path).doubts if "hull.stl" in doubt.words)
    assert "1 mesh of its looks is missing" in said.words
    assert "boxes" in said.words
    path.write_text(text.replace('contype="0" conaffinity="0"', ""))
    with pytest.raises(FileFormatError, match=r"hull\.stl, which it needs, is missing"):
        read_model(path)  # what it stands on is not guessed


def test_a_missing_mesh_of_a_urdf_without_collision_shapes_becomes_a_box(tmp_path):
    path = legs(tmp_path, "sole.stl", stl_text())
    text = path.read_text().replace("collision>", "visual>")
    path.write_text(text.replace("sole.stl", "none.stl"))
    model = read_model(path).compile()
    assert model.nmesh == 0
    assert (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX).all()
