"""Small recordings in each format, made up for tests: text of an ASF, an AMC and a BVH, bytes of a MAT file."""

import io

import numpy as np
import scipy.io

from controller.mocap.patterns import JAEGER_BONES, JAEGER_REST

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
