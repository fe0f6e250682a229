"""Small recordings in each format, made up for tests: text of an ASF, an AMC and a BVH, bytes of a MAT and a C3D."""

import io
import struct

import numpy as np
import scipy.io

from controller.motion.skeleton import JAEGER_BONES, JAEGER_REST

ASF = """\
# made up for a test
:version 1.10
:name mannequin
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
  four bones
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name hip
    direction 0.6 -0.8 0
    length 2
    axis 0 0 0 XYZ
  end
  begin
    id 2
    name leg
    direction 0 -1 0
    length 7.5
    axis 10 -20 30 XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
    id 3
    name foot
    direction 0 0 1
    length 2
    axis -90 0 20 ZYX
    dof rz rx
    limits (-45.0 90.0)
           (-inf inf)
  end
  begin
    id 4
    name chest
    direction 0 1 0
    length 5
    axis 0 0 0 XYZ
    dof rx
  end
:hierarchy
  begin
    root hip chest
    hip leg
    leg foot
  end
"""

AMC = """\
#!OML:ASF somewhere\\mannequin.ASF
:FULLY-SPECIFIED
:DEGREES
7
root 1 17 2 10 20 30
leg 5 -6 7
foot 8.5 1e1
chest -3
8
root 1.5 17 2 11 19 31
leg 5.5 -6 7.25
foot 8 10
chest -2
9
root 2 17 2 12 18 32
leg 6 -6 7.5
foot 7.5 10
chest -1
"""


BVH = """\
HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
  JOINT LeftUpLeg
  {
    OFFSET 10 0 0
    CHANNELS 3 Xrotation Yrotation Zrotation
    JOINT LeftLeg
    {
      OFFSET 0 -42 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      JOINT LeftFoot {
        OFFSET 0 -41 0
        CHANNELS 3 Yrotation Xrotation Zrotation
        End Site { OFFSET 0 -5 15 } }
    }
  }
  JOINT RightUpLeg
  {
    OFFSET -10 0 0
    CHANNELS 3 Xrotation Yrotation Zrotation
    JOINT RightLeg
    {
      OFFSET 0 -42 0
      CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
      JOINT RightFoot {
        OFFSET 0 -41 0
        CHANNELS 1 Xrotation
        End Site { OFFSET 0 -5 15 } }
    }
  }
  JOINT Spine
  {
    OFFSET 0 0 0
    CHANNELS 3 Zrotation Yrotation Xrotation
    JOINT Neck
    {
      OFFSET 0 50 0
      CHANNELS 3 Zrotation Yrotation Xrotation
      End Site
      {
        OFFSET 0 20 0
      }
    }
    JOINT LeftArm
    {
      OFFSET 0 50 0
      CHANNELS 3 Zrotation Yrotation Xrotation
      JOINT LeftForeArm
      {
        OFFSET 30 0 0
        CHANNELS 0
        End Site { OFFSET 26 0 0 }
      }
    }
    JOINT RightArm
    {
      OFFSET 0 50 0
      CHANNELS 3 Zrotation Yrotation Xrotation
      JOINT RightForeArm
      {
        OFFSET -30 0 0
        CHANNELS 0
        End Site { OFFSET -26 0 0 }
      }
    }
  }
}
MOTION
Frames: 2
Frame Time: .0083333
1 88 2 10 20 30 11 -7 5 20 3 4 5 6 7 1 2 3 0 -42 0 9 8 7 6 1 2 3 4 5 6 70 8 9 -60 11 12
2 87 3 11 19 29 12 -6 4 21 3 4 5 6 7 1 2 3 0 -42 0 9 8 7 6 1 2 3 4 5 6 71 8 9 -61 11 12
"""


def pattern_fields(frames=5, name="Bow"):
    """The fields of a pattern that turns and walks a little in the rest pose, as Jaeger's files have them."""
    data = np.zeros((frames, 61))
    data[:, 0] = 900.0 + np.arange(frames)
    data[:, 1] = 0.01
    data[:, 2] = 12.0
    data[:, 3] = -1.0
    data[:, 4:] = np.ravel(JAEGER_REST)
    data[:, 4] += 4e-15
    lengths = 100.0 + 10.0 * np.arange(len(JAEGER_BONES))
    return {f"nnRawData{name}": data, f"segLengths{name}": lengths[None, :], f"hmean{name}": np.array([[900.0]])}


def mat_bytes(fields, **options):
    """What MATLAB would save."""
    file = io.BytesIO()
    scipy.io.savemat(file, fields, **options)
    header = b"MATLAB 5.0 MAT-file, made up for a test".ljust(116)  # scipy's would hold the date
    return header + file.getvalue()[116:]


def c3d_bytes(labels, points, *, processor=84, scale=-0.1, rate=120.0, unit="mm", up="+Z", extra=()):
    """A C3D file of points (T, M, 3); NaN is a point not seen. A positive scale makes it one of int16."""
    order = ">" if processor == 86 else "<"

    def floats(*values):
        values = np.array(values, dtype=np.float64)
        if processor != 85:
            return values.astype(order + "f4").tobytes()
        halves = (4.0 * values).astype("<f4").view("<u2").reshape(-1, 2)[:, ::-1]
        return np.ascontiguousarray(halves).tobytes()

    def text(name, rows):
        width = max(map(len, rows))
        shape = [width] if len(rows) == 1 else [width, len(rows)]
        return name, -1, shape, "".join(row.ljust(width) for row in rows).encode("latin-1")

    def record(number, name, body):
        return struct.pack("bb", len(name), number) + name.encode() + struct.pack(order + "H", len(body) + 2) + body

    first, rest = list(labels[:255]), list(labels[255:])
    parameters = [
        ("USED", 2, [], struct.pack(order + "h", len(labels))),
        ("SCALE", 4, [], floats(scale)),
        ("RATE", 4, [], floats(rate)),
        ("DATA_START", 2, [], None),
        text("UNITS", [unit]),
        text("LABELS", first),
        *([text("LABELS2", rest)] if rest else []),
        *([text("Y_SCREEN", [up])] if up else []),
        *extra,
    ]

    def section(start):
        out = b"\0\0" + bytes([0, processor]) + record(-1, "POINT", b"\0")
        for name, kind, shape, values in parameters:
            values = struct.pack(order + "h", start) if values is None else values
            out += record(1, name, struct.pack("b", kind) + bytes([len(shape), *shape]) + values + b"\0")
        out += b"\0\0"
        return out.ljust(-(-len(out) // 512) * 512, b"\0")

    data_start = 2 + len(section(0)) // 512
    frames, count = points.shape[:2]
    unseen = np.isnan(points[..., :1])
    words = np.concatenate([np.where(unseen, 0.0, points), np.where(unseen, -1.0, 0.0)], axis=-1)
    if scale < 0:
        data = floats(*words.ravel())
    else:
        words[..., :3] /= scale
        data = np.round(words).astype(order + "i2").tobytes()
    header = bytes([2, 0x50]) + struct.pack(order + "5H", count, 0, 1, frames, 10)
    header += floats(scale) + struct.pack(order + "2H", data_start, 0) + floats(rate)
    return header.ljust(512, b"\0") + section(data_start) + data


MARKER_RATE = 60.0


def markers(frames=300, count=8, seed=1):
    """Markers on a body that sways, turns and goes away, mm."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames) / MARKER_RATE
    wave = np.stack([np.sin(6 * t), np.cos(6 * t), np.sin(12 * t)], axis=-1)
    sway = 60.0 * (wave @ rng.normal(size=(3, 3 * count))).reshape(frames, count, 3)
    shape = 500.0 * rng.normal(size=(count, 3)) + sway
    c, s, o = np.cos(t), np.sin(t), np.zeros_like(t)
    turn = np.stack([c, s, o, -s, c, o, o, o, o + 1.0], axis=-1).reshape(-1, 3, 3)
    return shape @ turn + np.stack([1000.0 * t, 300.0 * t**2, o], axis=-1)[:, None]
