"""Tests of robot models as other tools write them."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from motiondeck.pictures.side_by_side import PREFIX, SideBySide
from motiondeck_base.errors import FileFormatError
from sim.models.formats.model_text import urdf_speeds
from sim.models.formats.urdf_visuals import with_visuals
from sim.models.model_file import read_model
from sim.models.scenery import set_stage
from sim.robots.calibrate import calibrate
from sim.robots.robot import load_robot
from simulated_bodies import human
from small_robots import SERVOS, calibrated, humanoid, urdf


def with_meshes(folder, uri="package://legs_description/meshes/sole.obj"):
    """The URDF of two legs whose soles are meshes of a package, and the folder of that package."""
    package = folder / "legs_description"
    (package / "meshes").mkdir(parents=True)
    (package / "urdf").mkdir()
    corners = [(x, y, z) for x in (-0.03, 0.11) for y in (-0.03, 0.03) for z in (-0.04, -0.02)]
    faces = ["1 2 3", "2 4 3", "5 7 6", "6 7 8", "1 5 2", "2 5 6", "3 4 7", "4 8 7", "1 3 5", "3 7 5", "2 6 4", "4 6 8"]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {face}" for face in faces]
    (package / "meshes" / "sole.obj").write_text("\n".join(lines))
    box = '<geometry><box size="0.14 0.06 0.02"/></geometry><origin xyz="0.04 0 -0.03"/>'
    text = urdf()
    assert box in text
    path = package / "urdf" / "legs.urdf"
    path.write_text(text.replace(box, f'<geometry><mesh filename="{uri}"/></geometry>'))
    return path, package


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("notes.txt", "buy milk", r"notes.txt: not XML; a robot's model is an MJCF \(.xml\) or a URDF \(.urdf\)"),
        ("walk.bvh", "HIERARCHY", "not XML"),
        ("world.sdf", "<!-- a <robot> --><sdf><model/></sdf>", "another kind .<sdf>."),
        ("bot.toml", "model = 'bot.xml'", "under `model`"),
        ("bot.urdf", "<robot><xacro:include/></robot>", "xacro bot.urdf > robot.urdf"),
        ("folder/g1.xml", "<mujoco/>", "a folder; .*in it are g1.xml"),
        ("", "", "there is no such model file; a robot's model is"),
    ],
)
def test_a_file_of_another_kind_is_refused_and_says_what_was_expected(tmp_path, name, text, complaint):
    file = tmp_path / (name or "missing.xml")
    if name:
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
    with pytest.raises(FileFormatError, match=complaint) as caught:
        read_model(tmp_path / name.split("/")[0] if name else file)
    assert "\n" not in str(caught.value)


def test_a_model_without_its_mesh_names_the_missing_file_and_the_remedy(tmp_path):
    file = tmp_path / "bot.xml"
    file.write_text(
        '<mujoco><compiler meshdir="assets"/><asset><mesh name="hull" file="hull.stl"/></asset>'
        '<worldbody><body><freejoint/><geom type="mesh" mesh="hull"/></body></worldbody></mujoco>'
    )
    missing = tmp_path / "assets" / "hull.stl"
    with pytest.raises(FileFormatError) as caught:
        read_model(file)
    assert str(caught.value) == (
        f"{file}: {missing}, which it needs, is missing; copy it there with the other files of the model"
    )


@pytest.mark.parametrize(
    ("name", "head", "encoding"),
    [
        ("legs.urdf", '\n\n<?xml version="1.0"?>', "utf-8"),
        ("legs.urdf", '<!-- exported --><?xml version="1.0"?>', "utf-8"),
        ("legs.urdf", '<?xml version="1.0" encoding="iso-8859-1"?><!-- für é -->', "latin-1"),
        ("legs.urdf", "<!-- für é -->", "latin-1"),
        ("legs.urdf", '<?xml version="1.0" encoding="utf-16"?>', "utf-16"),
        ("legs.urdf", '<?xml version="1.0" encoding="utf-8"?>', "utf-8-sig"),
        ("legs.xml", "<!-- a URDF by another name -->", "utf-8"),
    ],
)
def test_a_urdf_is_read_whatever_its_encoding_its_first_line_and_its_name(tmp_path, name, head, encoding):
    path, package = with_meshes(tmp_path)
    file = path.with_name(name)
    file.write_bytes((head + path.read_text()).encode(encoding))
    assert read_model(file, {"legs_description": package}).compile().nmesh
    assert urdf_speeds(file) == dict.fromkeys(("l_hip", "l_knee", "l_ankle", "r_hip", "r_knee", "r_ankle"), 4.0)


@pytest.mark.filterwarnings("error")
def test_a_range_without_an_end_is_none(tmp_path, monkeypatch):
    path = tmp_path / "legs.urdf"
    endless = urdf().replace('lower="-2" upper="2"', 'lower="-inf" upper="INF"')
    path.write_text(endless.replace('velocity="4"', 'velocity="nan"').replace('effort="5"', 'effort="NaN"'))
    monkeypatch.chdir(tmp_path)
    found = calibrate(path)
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()
    assert len(found.unlimited) == len(found.joints) == 6
    assert not any("rad" in doubt.words for doubt in found.doubts)


def test_an_mjcf_in_an_encoding_that_mujoco_does_not_read_is_refused_with_a_remedy(tmp_path):
    path = tmp_path / "small.xml"
    path.write_bytes(humanoid().encode("utf-16"))
    with pytest.raises(FileFormatError, match=r"small\.xml: its text is UTF-16.*save it as UTF-8"):
        read_model(path)


def test_a_urdf_is_drawn_by_its_visual_shapes_and_moves_by_the_others(tmp_path):
    path, _ = with_meshes(tmp_path)
    sole = '<geometry><mesh filename="package://legs_description/meshes/sole.obj"/></geometry>'
    look = f'<visual><origin xyz="0 0 0.1"/>{sole}<material name="m"><color rgba="1 0 0 1"/></material></visual>'
    link = re.search(r'<link name="l_shank">', path.read_text())[0]
    path.write_text(path.read_text().replace(link, link + look))
    spec = read_model(path)
    plain = spec.compile()
    saved = mujoco.MjSpec.from_string(spec.to_xml())  # as the page gets it
    drawn = with_visuals(saved)[1]
    assert drawn.ngeom == plain.ngeom + 1
    shank = drawn.body("l_shank").id
    (shown,) = np.flatnonzero((drawn.geom_bodyid == shank) & (drawn.geom_group <= 2))
    assert drawn.geom_type[shown] == mujoco.mjtGeom.mjGEOM_MESH
    assert drawn.geom_rgba[shown].tolist() == [1, 0, 0, 1]
    others = (drawn.geom_bodyid == shank) & (np.arange(drawn.ngeom) != shown)
    assert (drawn.geom_group[others] > 2).all()
    assert np.array_equal(drawn.geom_group[drawn.geom_bodyid != shank], plain.geom_group[plain.geom_bodyid != shank])
    assert (drawn.nq, drawn.body_mass.tolist()) == (plain.nq, plain.body_mass.tolist())
    (tmp_path / "legs.toml").write_text(calibrate(path).to_toml(tmp_path))
    robot = load_robot(tmp_path / "legs.toml", human())
    assert (robot.drawn.ngeom, robot.drawn.nq) == (robot.model.ngeom + 1, robot.model.nq)
    beside = SideBySide(human(), tmp_path / "legs.toml", 1.0 / 60.0).model
    shank = beside.body(f"{PREFIX}l_shank").id
    assert (beside.geom_type[beside.geom_bodyid == shank] == mujoco.mjtGeom.mjGEOM_MESH).any()
    path.write_text("gone")
    assert with_visuals(saved)[1].ngeom == plain.ngeom


@pytest.mark.filterwarnings("error")
def test_a_robot_with_options_of_its_own_is_shown_beside_the_human(tmp_path):
    own = '<option ls_iterations="5"/><size njmax="5000" nconmax="2000" nuser_jnt="1" nkey="2"/>'
    own += '<visual><map zfar="30" shadowscale="2"/><global fovy="60"/><quality shadowsize="512"/>'
    own += '<rgba haze="0 0 0 1"/><scale com="2"/></visual><statistic extent="3" center="1 0 0"/><worldbody>'
    (tmp_path / "small.xml").write_text(humanoid().replace("<worldbody>", own, 1))
    (tmp_path / "small.toml").write_text(calibrated(tmp_path / "small.xml").to_toml(tmp_path))
    beside = SideBySide(human(), tmp_path / "small.toml", 1.0 / 60.0)
    assert beside.model.nq > len(SERVOS)


@pytest.mark.parametrize("scheme", ["package", "model"])
def test_a_package_is_found_above_the_file(tmp_path, scheme):
    path, _ = with_meshes(tmp_path, f"{scheme}://legs_description/meshes/sole.obj")
    model = read_model(path).compile()
    assert model.nmesh == 1
    assert calibrate(path).root_height == pytest.approx(0.44, abs=0.01)


def test_a_package_elsewhere_is_named_and_kept_in_the_robot_file(tmp_path):
    path, package = with_meshes(tmp_path)
    away = tmp_path / "away" / "legs.urdf"
    away.parent.mkdir()
    path.rename(away)
    moved = package.rename(tmp_path / "elsewhere")
    with pytest.raises(FileFormatError, match=r"package://legs_desc.*--package legs_description=FOLDER"):
        read_model(away)
    found = calibrate(away, {"legs_description": moved})
    file = tmp_path / "legs.toml"
    file.write_text(found.to_toml(tmp_path))
    assert load_robot(file, human()).model.nmesh == 1


@pytest.mark.parametrize("where", ["package://legs_description/meshes/", "../meshes/", "/nowhere/"])
def test_meshes_of_its_looks_alone_may_be_missing_and_calibration_says_so(tmp_path, where):
    look = f'<visual><geometry><mesh filename="{where}shank.stl"/></geometry></visual>'
    path = tmp_path / "legs.urdf"
    path.write_text(urdf().replace('<link name="l_shank">', f'<link name="l_shank">{look}'))
    found = calibrate(path)
    (said,) = (doubt for doubt in found.doubts if "shank.stl" in doubt.words)
    assert "1 mesh" in said.words
    assert ("--package legs_description=FOLDER" in said.words) == where.startswith("package")
    assert not said.fatal
    assert found.sound == calibrate_without_looks(tmp_path).sound
    assert with_visuals(read_model(path))[1].ngeom == read_model(path).compile().ngeom


def calibrate_without_looks(folder):
    (folder / "plain.urdf").write_text(urdf())
    found = calibrated(folder / "plain.urdf")
    assert not any("mesh" in doubt.words for doubt in found.doubts)
    return found


@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        ('ixx="0.01" iyy="0.01" izz="0.01"', 'ixx="0" iyy="0" izz="0"'),
        ('ixx="0.01" iyy="0.01" izz="0.01"', 'ixx="0.01" iyy="0.01" izz="0.9"'),
        ('<mass value="1"/>', '<mass value="0"/>'),
    ],
    ids=["zero", "unphysical", "no mass"],
)
def test_masses_and_inertias_that_cannot_be_are_balanced_and_said(tmp_path, was, becomes):
    path = tmp_path / "legs.urdf"
    path.write_text(urdf().replace(was, becomes))
    found = calibrate(path)
    assert found.mended
    model = read_model(path).compile()
    assert np.all(model.body_inertia[1:] > 0.0)
    assert np.all(model.body_inertia[1:].sum(axis=1) - 2.0 * model.body_inertia[1:].max(axis=1) >= -1e-9)


def test_a_link_without_weight_between_two_joints_gets_some(tmp_path):
    path = tmp_path / "legs.urdf"
    text = urdf().replace('<child link="l_thigh"/>', '<child link="l_hinge"/>')
    extra = (
        '<link name="l_hinge"/><joint name="l_twist" type="revolute"><parent link="l_hinge"/><child link="l_thigh"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="5" velocity="4"/></joint>'
    )
    path.write_text(text.replace("</robot>", f"{extra}</robot>"))
    assert read_model(path).compile().body("l_hinge").mass > 0.0
    assert calibrate(path).mended


def test_a_moment_of_inertia_below_zero_is_mended(tmp_path):
    path = tmp_path / "legs.urdf"
    path.write_text(urdf().replace('ixy="0" ', 'ixy="0.02" '))
    assert np.all(read_model(path).compile().body_inertia[1:] > 0.0)


def test_a_urdf_with_what_other_readers_let_pass(tmp_path):
    """Macros in comments, commas between numbers, points marked by balls without a size."""
    path = tmp_path / "legs.urdf"
    ball = '<collision><geometry><sphere radius="0"/></geometry></collision>'
    text = urdf().replace("</inertial>", f"</inertial>{ball}", 1).replace('xyz="0 0 -0.2"', 'xyz="0, 0, -0.2"')
    path.write_text(text.replace("</robot>", "<!-- <xacro:hand/> --></robot>"))
    plain = tmp_path / "plain.urdf"
    plain.write_text(urdf())
    model, expected = read_model(path).compile(), read_model(plain).compile()
    assert np.array_equal(model.body_pos, expected.body_pos)
    assert model.ngeom == expected.ngeom


def test_a_urdf_without_collision_shapes_stands_on_its_visual_ones(tmp_path):
    path = tmp_path / "legs.urdf"
    path.write_text(urdf().replace("collision>", "visual>"))
    assert calibrate(path).root_height == pytest.approx(0.44, abs=0.01)
    model = read_model(path).compile()
    assert model.geom_contype.all()
    assert with_visuals(read_model(path))[1].ngeom >= model.ngeom


def test_a_mesh_that_encloses_next_to_nothing_is_read(tmp_path):
    (tmp_path / "speck.obj").write_text(
        "v 0 0 0\nv 1e-5 0 0\nv 0 1e-5 0\nv 0 0 1e-5\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    path = tmp_path / "small.xml"
    speck = '<geom type="mesh" mesh="speck"/>'
    text = humanoid().replace("<worldbody>", '<asset><mesh file="speck.obj"/></asset><worldbody>')
    path.write_text(text.replace('<geom size="0.02"/>', f'<geom size="0.02"/>{speck}'))
    assert read_model(path).compile().nmesh == 1


def test_inertias_that_can_be_stay(tmp_path):
    path = tmp_path / "legs.urdf"
    path.write_text(urdf())
    assert not calibrate(path).mended


def test_a_model_with_names_of_the_stage_and_an_include_loads(tmp_path):
    (tmp_path / "looks.xml").write_text(
        '<mujocoinclude><asset><material name="floor"/><material name="sky"/></asset></mujocoinclude>'
    )
    text = humanoid().replace("<worldbody>", '<include file="looks.xml"/><worldbody>', 1)
    (tmp_path / "small.xml").write_text(text)
    file = tmp_path / "small.toml"
    file.write_text(calibrated(tmp_path / "small.xml").to_toml(tmp_path))
    model = load_robot(file, human()).model
    assert {"floor", "(floor)"} <= {model.material(k).name for k in range(model.nmat)}
    assert sum(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) == 1  # the file's own floor is left out


def test_a_urdf_stands_on_the_floor_of_the_stage(tmp_path):
    path = tmp_path / "legs.urdf"
    path.write_text(urdf())
    spec = read_model(path)
    set_stage(spec, 0.5)
    assert mujoco.mjtGeom.mjGEOM_PLANE in spec.compile().geom_type


def test_servos_take_over_no_defaults_of_the_file(tmp_path):
    """Models of robosuite have motors that take -1 to 1 by default: a servo would turn no further than a radian."""
    defaults = '<default><general gear="3" ctrllimited="true" ctrlrange="-1 1" forcelimited="true" forcerange="-2 2"/>'
    path = tmp_path / "small.xml"
    path.write_text(humanoid(servos=()).replace("<worldbody>", f"{defaults}</default><worldbody>", 1))
    model = read_model(path).compile()
    assert not model.actuator_ctrllimited.any()
    assert not model.actuator_forcelimited.any()
    assert np.array_equal(model.actuator_gear[:, 0], np.ones(model.nu))


def test_joints_that_tendons_drive_are_played(tmp_path):
    """Two motors pull at each ankle, one in front of each side of the heel; the arms are pulled at along their way."""
    ankles = [f"{side}_ankle{roll}" for side in ("left", "right") for roll in ("", "_roll")]
    others = [joint for joint in SERVOS if joint not in ankles and joint != "left_elbow"]
    tendons, motors = "", '<motor tendon="biceps"/>'
    for side in ("left", "right"):
        for name, sign in (("a", 1), ("b", -1)):
            pitch, roll = f'<joint joint="{side}_ankle" coef="1"/>', f'<joint joint="{side}_ankle_roll" coef="{sign}"/>'
            spring = ' stiffness="0.1"' * (side == "left" and name == "a")
            tendons += f'<fixed name="{side}_{name}"{spring}>{pitch}{roll}</fixed>'
            motors += f'<motor tendon="{side}_{name}"/>'
    text = humanoid(servos=others)
    for body in ("upper", "fore"):
        at = text.index("<geom", text.index(f'<body name="left_{body}"'))
        text = f'{text[:at]}<site name="{body}" pos="0.03 0 -0.07"/>{text[at:]}'
    tendons += '<spatial name="biceps"><site site="upper"/><site site="fore"/></spatial>'
    text = text.replace("<actuator>", f"<tendon>{tendons}</tendon><actuator>{motors}", 1)
    path = tmp_path / "small.xml"
    path.write_text(text)
    model = read_model(path).compile()
    assert {model.actuator(k).name for k in range(model.nu)} == set(SERVOS)
    assert np.all(model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT)
    # What only pulled is gone; a spring is not.
    assert [model.tendon(k).name for k in range(model.ntendon)] == ["left_a"]
    assert not calibrated(path).undriven


@pytest.mark.filterwarnings("error")
def test_masses_are_scaled_to_the_sum_that_a_file_asks_for(tmp_path):
    text = humanoid().replace("<compiler ", '<compiler settotalmass="14" ', 1)
    explicit = '<inertial mass="2" pos="0 0 0" diaginertia=".1 .1 .1"/>'
    text = text.replace('<joint name="left_knee"', f'{explicit}<joint name="left_knee"')
    path = tmp_path / "small.xml"
    path.write_text(text)
    model = read_model(path).compile()
    assert model.body_subtreemass[0] == pytest.approx(14.0)
    assert model.body("left_shank").inertia / model.body("left_shank").mass == pytest.approx([0.05] * 3)


def test_a_model_of_nested_includes_is_read_by_a_relative_path(tmp_path, monkeypatch):
    """MuJoCo looks for what an included file includes from the folder of that file on, by the model's own path."""
    parts = tmp_path / "robots" / "parts"
    parts.mkdir(parents=True)
    (parts / "looks.xml").write_text('<mujocoinclude><asset><material name="m"/></asset></mujocoinclude>')
    (parts / "more.xml").write_text('<mujocoinclude><include file="../parts/looks.xml"/></mujocoinclude>')
    text = humanoid().replace("<worldbody>", '<include file="parts/more.xml"/><worldbody>', 1)
    (tmp_path / "robots" / "small.xml").write_text(text)
    monkeypatch.chdir(tmp_path)
    assert read_model(Path("robots/small.xml")).materials
