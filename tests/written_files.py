"""Files of each format with a made-up person's motion, written for tests from the formats' specifications."""

import base64
import json
import struct
import warnings

import numpy as np
from scipy.spatial.transform import Rotation

from people import KEYS, OFFSET, PARENT

XSENS = {
    "hips": "Pelvis",
    "spine": "L5",
    "chest": "T8",
    "neck": "Neck",
    "head": "Head",
    **{
        f"{letter} {key}": side + name
        for letter, side in (("l", "Left"), ("r", "Right"))
        for key, name in (
            ("thigh", "UpperLeg"),
            ("shank", "LowerLeg"),
            ("foot", "Foot"),
            ("toes", "Toe"),
            ("collar", "Shoulder"),
            ("arm", "UpperArm"),
            ("forearm", "ForeArm"),
            ("hand", "Hand"),
        )
    },
}


def to_xsens(track):
    """x left, y up, z forward as x forward, y left, z up."""
    return np.asarray(track)[..., [2, 0, 1]]


def mvnx_text(motion, namespace=' xmlns="http://www.xsens.com/mvn/mvnx"'):
    """MVNX: segments with their points, joints, poses to calibrate by, then a frame a line with what nobody needs."""
    segments, joints = [], []
    for key, name in XSENS.items():
        points = [("j" + name, np.zeros(3))] + [
            ("p" + name + child, to_xsens(OFFSET[child])) for child in KEYS if PARENT[child] == key
        ]
        text = "".join(
            f'<point label="{label.replace(" ", "")}"><pos_b>'
            + "{:.6f} {:.6f} {:.6f}".format(*place)
            + "</pos_b></point>"
            for label, place in points
        )
        segments.append(f'<segment label="{name}" id="{len(segments) + 1}"><points>{text}</points></segment>')
        if PARENT[key] is not None:
            joints.append(
                f'<joint label="j{name}"><connector1>{XSENS[PARENT[key]]}/j{name}</connector1>'
                f"<connector2>{name}/j{name}</connector2></joint>"
            )

    def numbers(values):
        return " ".join(f"{value:.6f}" for value in np.ravel(values))

    still = numbers(np.tile([1.0, 0.0, 0.0, 0.0], len(XSENS)))
    frames = [
        f'<frame time="0" type="{kind}"><orientation>{still}</orientation><position>{numbers(np.ones(3 * len(XSENS)))}'
        "</position></frame>"
        for kind in ("identity", "tpose", "tpose-isb")
    ]
    for frame in range(len(motion.root)):
        quaternions = [
            motion.world[key].as_quat()[frame] for key in XSENS
        ]  # x, y, z, w in axes x left, y up, z forward
        orientation = [[q[3], q[2], q[0], q[1]] for q in quaternions]
        place = [to_xsens(motion.place[key][frame]) for key in XSENS]
        frames.append(
            f'<frame time="{1000 * frame / motion.rate:.0f}" index="{frame}" type="normal">'
            f"<orientation>{numbers(orientation)}</orientation><position>{numbers(place)}</position>"
            f"<velocity>{numbers(place)}</velocity></frame>"
        )
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<mvnx{namespace} version="4">\n<mvn version="2024"/>\n'
        f'<subject label="A" frameRate="{motion.rate:g}" segmentCount="{len(XSENS)}">\n<segments>{"".join(segments)}'
        f'</segments>\n<joints>{"".join(joints)}</joints>\n<frames segmentCount="{len(XSENS)}">\n'
        + "\n".join(frames)
        + "\n</frames></subject></mvnx>\n"
    )


def trc_text(labels, position, rate, unit="mm"):
    """TRC: three lines about the file, two with names and axes, an empty one, a line a frame; gaps are empty."""
    scale = {"mm": 1000.0, "m": 1.0}[unit]
    count = len(position)
    lines = [
        "PathFileType\t4\t(X/Y/Z)\twalk.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate:g}\t{rate:g}\t{count}\t{len(labels)}\t{unit}\t{rate:g}\t1\t{count}",
        "Frame#\tTime\t" + "\t\t\t".join(labels) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{number}" for number in range(1, len(labels) + 1) for axis in "XYZ"),
        "",
    ]
    for frame, row in enumerate(position):
        values = ["" if np.isnan(value) else f"{scale * value:.5f}" for value in row.ravel()]
        lines.append("\t".join([str(frame + 1), f"{frame / rate:.5f}", *values]))
    return "\n".join(lines) + "\n"


class GltfFile:
    """A glTF file as it grows: JSON, and one buffer."""

    def __init__(self):
        self.json = {"asset": {"version": "2.0"}, "nodes": [], "accessors": [], "bufferViews": [], "buffers": []}
        self.bytes = b""

    def accessor(self, values, kind="<f4", **more):
        values = np.asarray(values, kind)
        width = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[1 if values.ndim == 1 else values.shape[1]]
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.bytes), "byteLength": values.nbytes})
        self.bytes += values.tobytes() + b"\0" * (-values.nbytes % 4)
        code = {"<f4": 5126, "<i2": 5122, "<i1": 5120, "<u2": 5123}[kind]
        view = len(self.json["bufferViews"]) - 1
        self.json["accessors"].append(
            {"bufferView": view, "componentType": code, "count": len(values), "type": width} | more
        )
        return len(self.json["accessors"]) - 1

    def glb(self):
        self.json["buffers"] = [{"byteLength": len(self.bytes)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(self.bytes), b"BIN\0")
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks) + len(self.bytes)) + chunks + self.bytes

    def gltf(self, uri=None):
        packed = "data:application/octet-stream;base64," + base64.b64encode(self.bytes).decode()
        self.json["buffers"] = [{"byteLength": len(self.bytes), "uri": uri or packed}]
        return json.dumps(self.json)


MIXAMO = {
    "hips": "Hips",
    "spine": "Spine",
    "chest": "Spine1",
    "neck": "Neck",
    "head": "Head",
    "head end": "HeadTop_End",
    **{
        f"{letter} {key}": side + name
        for letter, side in (("l", "Left"), ("r", "Right"))
        for key, name in (
            ("thigh", "UpLeg"),
            ("shank", "Leg"),
            ("foot", "Foot"),
            ("toes", "ToeBase"),
            ("toes end", "Toe_End"),
            ("collar", "Shoulder"),
            ("arm", "Arm"),
            ("forearm", "ForeArm"),
            ("hand", "Hand"),
            ("hand end", "HandMiddle1"),
        )
    },
}


def gltf_file(motion, names=MIXAMO, scale=1.0, rotations="<f4"):
    """A skin of joints below a scaled node, each joint driven by rotations and the hips by their path too."""
    file = GltfFile()
    keys = [key for key in KEYS if key in names]
    index = {key: 1 + number for number, key in enumerate(keys)}
    children = {key: [index[child] for child in keys if PARENT[child] == key] for key in keys}
    file.json["nodes"] = [{"name": "Armature", "children": [1], "scale": [scale] * 3}] + [
        {"name": names[key], "translation": list(OFFSET[key] / scale)}
        | ({"children": children[key]} if children[key] else {})
        for key in keys
    ]
    time = file.accessor(np.arange(len(motion.root)) / motion.rate + 0.5)
    samplers, channels = [], []
    for key in keys:
        if key.endswith(" end"):
            continue
        turn = motion.turn[key].as_quat()
        more = {} if rotations == "<f4" else {"normalized": True}
        values = file.accessor(turn if not more else np.round(turn * np.iinfo(rotations).max), rotations, **more)
        samplers.append({"input": time, "output": values})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": index[key], "path": "rotation"}})
    samplers.append({"input": time, "output": file.accessor(motion.root / scale), "interpolation": "LINEAR"})
    channels.append({"sampler": len(samplers) - 1, "target": {"node": 1, "path": "translation"}})
    file.json["animations"] = [{"samplers": samplers, "channels": channels}]
    file.json["skins"] = [{"joints": list(index.values())}]
    return file


LAFAN1 = {key: name for key, name in MIXAMO.items() if not key.endswith(" end")} | {
    "chest": "Spine1",
    "l toes": "LeftToe",
    "r toes": "RightToe",
}
SOMA = MIXAMO | {
    "spine": "Spine1",
    "chest": "Chest",
    "neck": "Neck1",
    "head end": "HeadEnd",
    **{
        f"{letter} {key}": side + name
        for letter, side in (("l", "Left"), ("r", "Right"))
        for key, name in (("thigh", "Leg"), ("shank", "Shin"), ("toes end", "ToeEnd"), ("hand end", "HandMiddleEnd"))
    },
}


def own_axes():
    """How each joint's axes stand in the T pose of files whose bones lie along x: towards the joint's first child."""
    turn = {}
    for key in KEYS:
        child = next((child for child in KEYS if PARENT[child] == key), None)
        way = OFFSET[child] if child else np.array([1.0, 0.0, 0.0])
        turn[key] = Rotation.align_vectors([way / np.linalg.norm(way)], [[1.0, 0.0, 0.0]])[0]
    return turn


def bvh_text(
    motion,
    names=MIXAMO,
    *,
    order="ZYX",
    along_x=False,
    floor=None,
    everywhere=False,
    offset_words=3,
    offset=OFFSET,
    unit=0.01,
):
    """BVH, y up.

    Args:
        motion: whose.
        names: of the joints that are written.
        order: of rotations, of all joints or by joint.
        along_x: bones lie along the x axis of their own joint, so that the zero pose means nothing.
        floor: the name of a joint at the origin that carries the hips.
        everywhere: every joint has position channels.
        offset_words: how many numbers an OFFSET has; SOMA writes six.
        offset: where each joint stands against its parent, m.
        unit: what one length in the file is, m.
    """
    axes = own_axes() if along_x else dict.fromkeys(KEYS, Rotation.identity())
    keys = [key for key in KEYS if key in names]
    lines, columns = ["HIERARCHY"], []
    frames = len(motion.root)

    def offset_line(values):
        return "OFFSET " + " ".join(f"{value:.6f}" for value in [*values, *[0.5] * (offset_words - 3)])

    def write(key, depth):
        above = PARENT[key]
        local = axes[above].inv().apply(offset[key]) if above else np.zeros(3)
        head = "ROOT" if above is None and floor is None else "JOINT"
        moves = above is None or everywhere
        own_order = order if isinstance(order, str) else order[key]
        turns = " ".join(f"{axis}rotation" for axis in own_order)
        places = "6 Xposition Yposition Zposition" if moves else "3"
        lines.extend([f"{head} {names[key]}", "{", offset_line(local / unit), f"CHANNELS {places} {turns}"])
        if moves:
            columns.append((motion.root if above is None else np.tile(local, (frames, 1))) / unit)
        world = motion.world[key] * axes[key]
        own = world if above is None else (motion.world[above] * axes[above]).inv() * world
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # where two axes fall together, one of the angles is as good as another
            columns.append(own.as_euler(own_order, degrees=True))
        children = [child for child in keys if PARENT[child] == key]
        for child in children:
            write(child, depth + 1)
        if not children:
            lines.extend(["End Site", "{", offset_line(np.zeros(3)), "}"])
        lines.append("}")

    if floor:
        lines.extend([f"ROOT {floor}", "{", offset_line(np.zeros(3)), "CHANNELS 6 Xposition Yposition Zposition "])
        lines[-1] += "Zrotation Yrotation Xrotation"
        columns.append(np.zeros((frames, 6)))
    write("hips", 1)
    if floor:
        lines.append("}")
    lines += ["MOTION", f"Frames: {frames}", f"Frame Time: {1.0 / motion.rate:.7f}"]
    lines += [" ".join(f"{value:.8f}" for value in row) for row in np.concatenate(columns, axis=1)]
    return "\n".join(lines) + "\n"
