"""glTF and VRM files that the test writes from the specification, with every way to interpolate and to store."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from controller.motion.clip import ReadingOptions
from controller.motion.formats.reading import read_clip
from controller.motion.joint_tree import SeveralPeopleError
from motiondeck_base.errors import FileFormatError
from people import KEYS, OFFSET, check_person, moving
from written_files import GltfFile, gltf_file

MOTION = moving()
VRM = {
    "hips": "hips",
    "spine": "spine",
    "chest": "chest",
    "neck": "neck",
    "head": "head",
    **{
        f"{letter} {key}": side + name
        for letter, side in (("l", "left"), ("r", "right"))
        for key, name in (
            ("thigh", "UpperLeg"),
            ("shank", "LowerLeg"),
            ("foot", "Foot"),
            ("toes", "Toes"),
            ("collar", "Shoulder"),
            ("arm", "UpperArm"),
            ("forearm", "LowerArm"),
            ("hand", "Hand"),
        )
    },
}
ENDS = tuple(key for key in KEYS if key.endswith(" end"))


def write(tmp_path, file, name="walk.glb"):
    content = file if isinstance(file, bytes) else file.gltf().encode() if name.endswith(".gltf") else file.glb()
    (tmp_path / name).write_bytes(content)
    return tmp_path / name


@pytest.mark.parametrize("name", ["walk.glb", "walk.gltf", "walk.vrm"])
@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_joints_are_where_the_file_has_them(tmp_path, name, scale):
    """Scaled by a node above, as exporters do that work in centimetres."""
    clip = read_clip(write(tmp_path, gltf_file(MOTION, scale=scale), name))
    assert (len(clip), clip.rate) == (25, 60.0)
    check_person(clip, MOTION, tolerance=2e-6)


def test_a_buffer_may_lie_beside_the_file(tmp_path):
    file = gltf_file(MOTION)
    (tmp_path / "walk.gltf").write_text(file.gltf("walk data.bin".replace(" ", "%20")))
    (tmp_path / "walk data.bin").write_bytes(file.bytes)
    check_person(read_clip(tmp_path / "walk.gltf"), MOTION, tolerance=2e-6)


def test_rotations_may_be_whole_numbers(tmp_path):
    check_person(read_clip(write(tmp_path, gltf_file(MOTION, rotations="<i2"))), MOTION, tolerance=3e-4)


@pytest.mark.parametrize("version", ["VRMC_vrm", "VRMC_vrm_animation", "VRM"])
def test_vrm_says_which_node_is_which_bone(tmp_path, version):
    """Its nodes may be called anything, and have no ends."""
    names = {key: f"node-{number}" for number, key in enumerate(VRM)}
    file = gltf_file(MOTION, names)
    nodes = {VRM[key]: 1 + number for number, key in enumerate(key for key in KEYS if key in VRM)}
    if version == "VRM":
        bones = [{"bone": name, "node": node} for name, node in nodes.items()]
    else:
        bones = {name: {"node": node} for name, node in nodes.items()}
    file.json["extensions"] = {version: {"humanoid": {"humanBones": bones}}}
    del file.json["skins"]
    clip = read_clip(write(tmp_path, file, "walk.vrma"))
    assert {"leftUpperLeg", "rightLowerArm"} <= {bone.split("-")[0] for bone in clip.skeleton.bones}
    check_person(clip, MOTION, tolerance=2e-6, lacking=ENDS)


@pytest.mark.parametrize("way", ["LINEAR", "STEP", "CUBICSPLINE"])
def test_sparse_keys_are_interpolated_as_the_specification_says(tmp_path, way):
    """A leg that is driven by four keys, the rest at rest; sampled at the 30 Hz that sparse keys get."""
    keys = np.array([0.0, 0.4, 0.5, 1.0])
    turns = Rotation.from_euler("xyz", [[0, 0, 0], [40, 10, 0], [-30, 0, 20], [10, 5, 5]], degrees=True)
    slopes = np.zeros((4, 4))
    file = gltf_file(MOTION)
    leg = next(number for number, node in enumerate(file.json["nodes"]) if node.get("name") == "LeftUpLeg")
    values = turns.as_quat()
    if way == "CUBICSPLINE":
        slopes = np.random.default_rng(2).normal(0.0, 0.3, (4, 4))
        values = np.stack([slopes, values, slopes], axis=1).reshape(-1, 4)
    sampler = {"input": file.accessor(keys), "output": file.accessor(values), "interpolation": way}
    file.json["animations"] = [
        {"samplers": [sampler], "channels": [{"sampler": 0, "target": {"node": leg, "path": "rotation"}}]}
    ]
    clip = read_clip(write(tmp_path, file))
    assert (clip.rate, len(clip)) == (30.0, 31)
    time = np.clip(np.arange(31) / 30.0, 0.0, 1.0)
    at = np.clip(np.searchsorted(keys, time + 1e-9, side="right") - 1, 0, 2)
    if way == "LINEAR":
        turn = Slerp(keys, turns)(time)
    elif way == "STEP":
        turn = turns[np.where(time >= 1.0, 3, at)]
    else:
        span = np.diff(keys)[at][:, None]
        s = (time - keys[at])[:, None] / span
        start, end = turns.as_quat()[at], turns.as_quat()[at + 1]
        hermite = (2 * s**3 - 3 * s**2 + 1) * start + span * (s**3 - 2 * s**2 + s) * slopes[at]
        hermite += (3 * s**2 - 2 * s**3) * end + span * (s**3 - s**2) * slopes[at + 1]
        turn = Rotation.from_quat(hermite)
    start = clip.root_position + (OFFSET["l thigh"])[[2, 0, 1]]
    knee = start + turn.apply(OFFSET["l shank"])[:, [2, 0, 1]]
    assert np.linalg.norm(clip.joints() - knee[:, None], axis=-1).max(axis=0).min() < 1e-6


def test_of_several_animations_the_longest_is_read(tmp_path):
    file = gltf_file(MOTION)
    short = {"input": file.accessor(np.array([0.0, 0.1])), "output": file.accessor(np.tile([0, 0, 0, 1.0], (2, 1)))}
    channel = {"sampler": 0, "target": {"node": 1, "path": "rotation"}}
    file.json["animations"] = [{"samplers": [short], "channels": [channel]}, *file.json["animations"]]
    check_person(read_clip(write(tmp_path, file)), MOTION, tolerance=2e-6)


def test_a_sparse_accessor_replaces_some_numbers(tmp_path):
    file = gltf_file(MOTION)
    path = file.json["accessors"][-1]
    rows = np.array([3, 4])
    right = (MOTION.root[rows]).astype("<f4")
    where, what = file.accessor(rows, "<u2"), file.accessor(right)
    views = [file.json["accessors"][index]["bufferView"] for index in (where, what)]
    path["sparse"] = {
        "count": 2,
        "indices": {"bufferView": views[0], "componentType": 5123},
        "values": {"bufferView": views[1]},
    }
    begin = file.json["bufferViews"][path["bufferView"]]["byteOffset"] + 12 * 3
    file.bytes = file.bytes[:begin] + b"\0" * 24 + file.bytes[begin + 24 :]
    check_person(read_clip(write(tmp_path, file)), MOTION, tolerance=2e-6)


def changed(**parts):
    """A file with some of its JSON replaced."""
    file = gltf_file(MOTION)
    file.json |= parts
    return file


def nodes_with(**parts):
    nodes = gltf_file(MOTION).json["nodes"]
    return [nodes[0], nodes[1] | parts, *nodes[2:]]


def accessor_with(number, **parts):
    accessors = gltf_file(MOTION).json["accessors"]
    accessors[number] |= parts
    return accessors


GLB = gltf_file(MOTION).glb()


@pytest.mark.parametrize(
    ("file", "said"),
    [
        (changed(animations=[]), "there is no animation in it, only a model"),
        (changed(animations=[{"channels": [], "samplers": []}]), "its animations move no node"),
        (changed(asset={"version": "1.0"}), "glTF of version 1.0 is not read"),
        (changed(extensionsRequired=["EXT_meshopt_compression"]), "its numbers are packed"),
        (changed(nodes=nodes_with(children=[999])), "node 999 is named, but there are 27"),
        (changed(nodes=nodes_with(children=[0])), "has two parents|its own ancestor"),
        (changed(nodes=nodes_with(children=[1])), "has two parents"),
        (changed(nodes=nodes_with(translation=["a", 0, 0])), r"no glTF file \(Expected `float`, got `str`"),
        (changed(accessors=accessor_with(0, count=10**9)), "accessor 0 counts 1000000000"),
        (changed(accessors=accessor_with(0, count=10**5)), "ends before its numbers"),
        (changed(accessors=accessor_with(0, count=3)), "keyframes of node .* are broken"),
        (changed(accessors=accessor_with(0, byteOffset=-4)), "buffer view 0 is broken"),
        (changed(accessors=accessor_with(1, type="VEC3")), "accessor 1 holds VEC3, where 4 numbers are needed"),
        (changed(accessors=[]), "accessor 0 is named, but there are 0"),
        (changed(bufferViews=[]), "buffer view 0 is named"),
        (GLB[: len(GLB) // 2], "cut short|ends before its numbers"),
        (GLB[:30], "cut short"),
        (b"glTF", "cut short"),
        (b"{", "this is no glTF file"),
        (b"[1, 2]", "this is no glTF file"),
    ],
)
def test_a_broken_file_is_one_line(tmp_path, file, said):
    with pytest.raises(FileFormatError, match=said) as caught:
        read_clip(write(tmp_path, file))
    assert "walk.glb" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("uri", ["../other.bin", "/etc/passwd", "https://host/x.bin", "%2e%2e/other.bin", "", "a\0b"])
def test_only_files_in_the_same_folder_are_opened(tmp_path, uri):
    (tmp_path / "other.bin").write_bytes(gltf_file(MOTION).bytes)
    (tmp_path / "in").mkdir()
    file = gltf_file(MOTION)
    text = json.dumps(json.loads(file.gltf()) | {"buffers": [{"byteLength": len(file.bytes), "uri": uri}]})
    (tmp_path / "in" / "walk.gltf").write_text(text)
    with pytest.raises(FileFormatError, match="a buffer lies elsewhere"):
        read_clip(tmp_path / "in" / "walk.gltf")


def test_an_empty_file_has_no_animation(tmp_path):
    with pytest.raises(FileFormatError, match="no animation"):
        read_clip(write(tmp_path, GltfFile()))


@pytest.mark.parametrize("below_one", [False, True])
def test_one_of_two_armatures_is_read_by_name(tmp_path, below_one):
    file = gltf_file(MOTION, scale=0.01)
    nodes, (skin,), (animation,) = file.json["nodes"], file.json["skins"], file.json["animations"]
    count = len(nodes)
    again = [
        node | ({"children": [count + c for c in node["children"]]} if "children" in node else {}) for node in nodes
    ]
    nodes += [again[0] | {"name": "Ben"}, *again[1:]]
    if below_one:
        nodes.append({"name": "Scene", "children": [0, count]})
    file.json["skins"].append({"joints": [count + joint for joint in skin["joints"]]})
    animation["channels"] += [
        channel | {"target": channel["target"] | {"node": count + channel["target"]["node"]}}
        for channel in animation["channels"]
    ]
    path = write(tmp_path, file)
    with pytest.raises(SeveralPeopleError, match=r"2 people \(Armature, Ben\)"):
        read_clip(path)
    check_person(read_clip(path, ReadingOptions(person="Ben")), MOTION, tolerance=2e-6)
