"""BVH, AMC, C3D and Jaeger's patterns read once more, from their specifications and with scipy, in the files' axes.

Nothing here is shared with the readers that it judges.
"""

import re

import numpy as np
import scipy.io
from scipy.spatial.transform import Rotation

# Where the landmarks of each source are: joints of the files by their own names. Limbs: hip, knee, ankle, toe base,
# shoulder, elbow, wrist, then a point on the hand; a middle point is the mean of those given.
BANDAI = (
    ("UpperLeg_{}", "LowerLeg_{}", "Foot_{}", "Toes_{}", "UpperArm_{}", "LowerArm_{}", "Hand_{}", None),
    {"root": "Spine", "waist": "Chest", "neck": "Neck", "head": None},
    ("L", "R"),
)
MOTIONBUILDER = (
    ("{}UpLeg", "{}Leg", "{}Foot", "{}ToeBase", "{}Arm", "{}ForeArm", "{}Hand", "{}HandIndex1"),
    {"root": "LowerBack", "waist": "Spine", "neck": "Neck", "head": "Head end"},
    ("Left", "Right"),
)
MAX = (
    ("{}Hip", "{}Knee", "{}Ankle", "{}Toe", "{}Shoulder", "{}Elbow", "{}Wrist", None),
    {"root": "lowerback", "waist": "Chest", "neck": "lowerneck", "head": "Head end"},
    ("Left", "Right"),
)
ICLONE = (
    ("{}_Thigh", "{}_Calf", "{}_Foot", None, "{}_Upperarm", "{}_Forearm", "{}_Hand", None),
    {"root": "CC_Base_Waist", "waist": "CC_Base_Spine02", "neck": "CC_Base_NeckTwist01", "head": None},
    ("CC_Base_L", "CC_Base_R"),
)
ACCLAIM = (
    ("{}hipjoint", "{}femur", "{}tibia", "{}foot", "{}clavicle", "{}humerus", "{}wrist", "{}hand"),
    {"root": "root", "waist": "lowerback", "neck": "thorax", "head": "head"},
    ("l", "r"),
)
ENDS = ("hip", "kne", "ank", "foo", "sho", "elb", "wri", "han")


def bvh_joints(text, frames=slice(None)):
    """Where each joint of a BVH is, by name, shape (T, 3), in the file's axes and unit.

    A joint's channels apply in their order, the first outermost; position channels replace its OFFSET.
    """
    hierarchy, motion = text.split("MOTION")
    rows = np.array([line.split() for line in motion.strip().splitlines()[2:] if line.strip()], dtype=float)[frames]
    place, turn, above, column = {}, {}, [], 0
    offset, parent = np.zeros((len(rows), 3)), None
    words = iter(re.findall(r"\S+", hierarchy))
    name = None
    for word in words:
        if word in ("ROOT", "JOINT"):
            name = next(words)
        elif word == "End":
            next(words)
            name = f"{above[-1]} end"
        elif word == "{":
            above.append(name)
        elif word == "}":
            above.pop()
        elif word == "OFFSET":
            offset = np.tile([float(next(words)) for _ in range(3)], (len(rows), 1))
            parent = above[-2] if len(above) > 1 else None
            turn[name], place[name] = _placed(turn, place, parent, offset, Rotation.identity(len(rows)))
        elif word == "CHANNELS":
            order, angles = "", []
            for _ in range(int(next(words))):
                channel = next(words)
                if channel.endswith("rotation"):
                    order += channel[0].upper()
                    angles.append(rows[:, column])
                else:
                    offset[:, "XYZ".index(channel[0].upper())] = rows[:, column]
                column += 1
            own = Rotation.identity(len(rows))
            if order:
                own = Rotation.from_euler(order, np.array(angles).T.reshape(len(rows), -1), degrees=True)
            turn[name], place[name] = _placed(turn, place, parent, offset, own)
    return place


def _placed(turn, place, parent, offset, own):
    if parent is None:
        return own, offset.copy()
    return turn[parent] * own, place[parent] + turn[parent].apply(offset)


def amc_joints(asf, amc, frames=slice(None)):
    """Where each bone of an ASF ends in each frame of an AMC, by name, in the file's axes (y up), m; "root" too."""
    return amc_bones(asf, amc, frames)[0]


def amc_bones(asf, amc, frames=slice(None)):
    """As `amc_joints`, and how each bone is turned, its vector in the zero pose, and the one it hangs from.

    Lengths are inches divided by `length`. A bone turns by C M C^-1 against its parent: C from `axis`, M from its
    channels; both rotate about fixed axes, the first angle first.
    """
    section = dict(re.findall(r"^:(\w+)(.*?)(?=^:|\Z)", asf, flags=re.MULTILINE | re.DOTALL))
    unit = 0.0254 / float(_found(r"length\s+(\S+)", section["units"]))
    bones = {}
    for block in re.findall(r"begin(.*?)end\b", section["bonedata"], flags=re.DOTALL):
        fields = {line.split()[0]: line.split()[1:] for line in block.strip().splitlines() if line.split()}
        bones[fields["name"][0]] = fields
    order = _found(r"order\s+(.*)", section["root"]).lower().split()
    parent = {}
    for line in section["hierarchy"].splitlines():
        words = line.split()
        parent |= {child: words[0] for child in words[1:] if words[0] not in ("begin", "end")}
    blocks = re.split(r"^\d+\s*$", amc, flags=re.MULTILINE)[1:][frames]
    values = {}
    for block in blocks:
        for line in block.strip().splitlines():
            name, *numbers = line.split()
            values.setdefault(name, []).append([float(number) for number in numbers])
    root = dict(zip(order, np.array(values["root"]).T, strict=True))
    place = {"root": np.stack([root[axis] for axis in ("tx", "ty", "tz")], axis=1) * unit}
    turn = {"root": _fixed("".join(c[1] for c in order if c[0] == "r"), [root[c] for c in order if c[0] == "r"])}
    vectors = {}
    for name, above in parent.items():
        fields = bones[name]
        axis = Rotation.from_euler(fields["axis"][3].lower(), [float(a) for a in fields["axis"][:3]], degrees=True)
        channels = fields.get("dof", [])
        own = Rotation.identity(len(blocks))
        if channels:
            own = _fixed("".join(channel[1] for channel in channels), np.array(values[name]).T)
        turn[name] = turn[above] * (axis * own * axis.inv())
        vector = np.array([float(d) for d in fields["direction"]])
        vector *= float(fields["length"][0]) * unit / np.linalg.norm(vector)
        place[name] = place[above] + turn[name].apply(vector)
        vectors[name] = vector
    return place, turn, vectors, parent


def _found(pattern, text):
    found = re.search(pattern, text)
    assert found is not None, pattern
    return found.group(1)


def _fixed(letters, angles):
    return Rotation.from_euler(letters, np.array(angles).T, degrees=True)


def landmarks(joints, table):
    """Where the file has the root and the landmarks that its source names, by canonical bone."""
    limbs, middle, sides = table
    found = {
        letter + end: joints[name.format(side)]
        for letter, side in zip("lr", sides, strict=True)
        for end, name in zip(ENDS, limbs, strict=True)
        if name is not None
    }
    return found | {{"waist": "back"}.get(end, end): joints[name] for end, name in middle.items() if name is not None}


def c3d_points(path):
    """The points of a C3D of Intel floats or DEC integers, shape (T, M, 3), in the file's unit; NaN where not seen."""
    raw = path.read_bytes()
    dec = raw[512 + 3] == 85
    header = np.frombuffer(raw[:512], "<u2")
    points, frames, start = int(header[1]), int(header[4]) - int(header[3]) + 1, 512 * (int(header[8]) - 1)
    whole = np.frombuffer(raw[12:16], "<u2")
    scale = float(np.frombuffer(whole[::-1].tobytes() if dec else whole.tobytes(), "<f4")[0]) / (4.0 if dec else 1.0)
    kind, by = ("<f4", 1.0) if scale < 0 else ("<i2", scale)
    values = np.frombuffer(raw[start:], kind)[: frames * points * 4].reshape(frames, points, 4).astype(float)
    values[(values[..., 3] < 0) | (values[..., :3] == 0).all(axis=-1)] = np.nan
    return values[..., :3] * by


def pattern_channels(path):
    """The channels of one of Jaeger's patterns, shape (T, 61), in the units that ours has them in."""
    fields = scipy.io.loadmat(path)
    raw = next(value for name, value in fields.items() if name.startswith("nnRawData"))
    channels = raw * np.array([1e-3, 120.0, 0.12, 0.12, *np.ones(57)])  # mm, rad a frame, mm a frame
    channels[:, [4, 16]] = 0.0
    return channels
