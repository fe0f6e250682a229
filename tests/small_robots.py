"""Robots made up for tests: a small humanoid as MJCF or URDF, with whatever names, axes and faults a test wants."""

from dataclasses import replace

import numpy as np

from sim.robots.calibrate import calibrate

_CALIBRATED = {}


def calibrated(path):
    """What `calibrate` finds in a model file that needs no others; it takes long, so a model is calibrated once."""
    text = path.name, path.read_text()
    if text not in _CALIBRATED:
        _CALIBRATED[text] = calibrate(path)
    return replace(_CALIBRATED[text], model=path.resolve())


LEG = """
<body name="{s}_hip" pos="{x} {y} 0">
  <joint name="{s}_hip_yaw" axis="0 0 1" range="-1 1"/>
  <geom size="0.02"/>
  <body name="{s}_thigh">
    <joint name="{s}_hip_roll" axis="{sign} 0 0" range="-1 1"/><joint name="{s}_hip_pitch" axis="0 1 0" range="-2 1"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.03"/>
    <body name="{s}_shank" pos="0 0 -0.2">
      <joint name="{s}_knee" axis="0 1 0" range="0 2.4"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.025"/>
      <body name="{s}_sole" pos="0 0 -0.2">
        <joint name="{s}_ankle" axis="0 {sign} 0" range="-1.2 1.2"/>
        <joint name="{s}_ankle_roll" axis="1 0 0" range="-.8 .8"/>
        <geom type="box" pos="0.04 0 -0.02" size="0.07 0.03 0.01"/>
      </body>
    </body>
  </body>
</body>"""
ARM = """
<body name="{s}_shoulder" pos="0 {ay} 0.25">
  <joint name="{s}_arm_pitch" axis="0 1 0" range="-3.5 2.5"/>
  <geom size="0.02"/>
  <body name="{s}_upper">
    <joint name="{s}_arm_roll" axis="1 0 0" range="-2 2"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.15" size="0.02"/>
    <body name="{s}_fore" pos="0 0 -0.15">
      <joint name="{s}_elbow" axis="0 -1 0" range="0 2.5"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.15" size="0.02"/>
    </body>
  </body>
</body>"""
SERVOS = [
    f"{s}_{j}"
    for s in ("left", "right")
    for j in ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle", "ankle_roll", "arm_pitch", "arm_roll", "elbow")
]


def humanoid(free="<freejoint/>", extra="", servos=SERVOS, trunk="", body='pos="0 0 0.5"', rename=lambda text: text):
    """An MJCF with 18 servos; the right leg's roll and ankle joints turn the other way than the left one's."""
    limbs = "".join(
        LEG.format(s=s, x=0, y=y, sign=sign) + ARM.format(s=s, ay=2.2 * y)
        for s, y, sign in (("left", 0.06, 1), ("right", -0.06, -1))
    )
    acts = "".join(f'<position name="{name}" joint="{name}" kp="20"/>' for name in servos)
    text = f"""<mujoco model="small"><compiler angle="radian" autolimits="true"/><worldbody>
      <geom name="floor" type="plane" size="1 1 1"/>
      <body name="trunk" {body}>{free}<geom type="box" pos="0 0 0.13" size="0.06 0.1 0.13"/>{trunk}{limbs}</body>
    </worldbody>{f"<actuator>{acts}</actuator>" if servos else ""}{extra}</mujoco>"""
    return rename(text)


def urdf():
    """The same legs as a URDF, whose base is a link of its own."""
    links, joints = [], []

    def link(name, size, at):
        box = f'<geometry><box size="{size}"/></geometry><origin xyz="{at}"/>'
        links.append(
            f'<link name="{name}"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" '
            f'ixz="0" iyz="0"/></inertial><collision>{box}</collision></link>'
        )

    def joint(name, parent, child, at, axis):
        joints.append(
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>'
            f'<axis xyz="{axis}"/><limit lower="-2" upper="2" effort="5" velocity="4"/></joint>'
        )

    link("base", "0.1 0.2 0.3", "0 0 0.1")
    for s, y in (("l", 0.07), ("r", -0.07)):
        link(f"{s}_thigh", "0.05 0.05 0.2", "0 0 -0.1")
        link(f"{s}_shank", "0.05 0.05 0.2", "0 0 -0.1")
        link(f"{s}_foot", "0.14 0.06 0.02", "0.04 0 -0.03")
        joint(f"{s}_hip", "base", f"{s}_thigh", f"0 {y} 0", "0 1 0")
        joint(f"{s}_knee", f"{s}_thigh", f"{s}_shank", "0 0 -0.2", "0 1 0")
        joint(f"{s}_ankle", f"{s}_shank", f"{s}_foot", "0 0 -0.2", "0 1 0")
    return f'<robot name="legs">{"".join(links)}{"".join(joints)}</robot>'


def full_humanoid(
    *,
    waist="yaw roll pitch",
    hip="pitch roll yaw",
    ankle="pitch roll",
    shoulder="pitch roll yaw",
    wrist="yaw pitch roll",
    neck="yaw pitch",
    eyes=False,
    fingers=True,
    lying=False,
    rods=False,
    hung=False,
    spread=0.0,
    raised=0.0,
    arms=("left", "right"),
):
    """An MJCF of a humanoid, 1.3 m tall, with the named hinges in the order of their names.

    Yaw turns about the segment and pitch and roll bend it. A thigh's yaw sits halfway down the thigh, a wrist's yaw
    halfway down the forearm. The limbs of the model are straight and hang down.

    Args:
        waist, hip, ankle, shoulder, wrist, neck: hinges of each joint, of "yaw", "pitch" and "roll".
        eyes: whether the head has two that turn.
        fingers: whether each hand has two, with two hinges each.
        lying: whether the model is written with y up and z ahead instead of z up and x ahead.
        hung: whether the free root is the trunk, and pelvis and legs hang from the waist.
        spread, raised: by how much the arms are held to the sides and ahead, rad.
        arms: which it has.
        rods: whether a rod on hinges of its own runs beside each shank to the foot and closes a loop.
    """
    axes = {"pitch": (0, 1, 0), "roll": (1, 0, 0), "yaw": (0, 0, 1)}
    actuators, loops = [], []

    def v(x, y, z):
        return f"{y:g} {z:g} {x:g}" if lying else f"{x:g} {y:g} {z:g}"

    def capsule(length, radius=0.03, x=0.0):
        if length <= 0.0:
            return f'<geom size="{radius}"/>'
        return f'<geom type="capsule" fromto="{v(x, 0, 0)} {v(x, 0, -length)}" size="{radius}"/>'

    def hinge(name, kind):
        actuators.append(name)
        return f'<joint name="{name}" axis="{v(*axes[kind])}" range="-2.5 2.5"/>'

    def chain(prefix, kinds, at, then, along=None, down=0.0):
        """Bodies with one hinge each, all in one place but for the kind `along`, and what hangs from the last one."""
        text, ends, place = "", "", at
        for kind in kinds.split():
            lower = down if kind == along else 0.0
            place = (place[0], place[1], place[2] - lower)
            text += f'<body name="{prefix}_{kind}" pos="{v(*place)}">{hinge(f"{prefix}_{kind}_joint", kind)}'
            text += capsule(0, 0.02)
            ends, place = ends + "</body>", (0.0, 0.0, 0.0)
        return text + then + ends if text else f'<body name="{prefix}" pos="{v(*at)}">{then}</body>'

    def leg(side, y):
        box = f'<geom type="box" pos="{v(0.04, 0, -0.03)}" size="{v(0.1, 0.04, 0.01)}"/>'
        rod = ""
        if rods:
            rod = f'<body name="{side}_rod" pos="{v(-0.05, 0, 0)}">{hinge(f"{side}_crank", "pitch")}'
            rod += capsule(0.3, 0.01) + "</body>"
            loops.append(f'<connect body1="{side}_rod" body2="{side}_ankle_pitch" anchor="{v(0, 0, -0.3)}"/>')
        foot = chain(f"{side}_ankle", ankle, (0, 0, -0.3), box)
        shank = f'<body name="{side}_shin" pos="{v(0, 0, -0.15)}">{hinge(f"{side}_knee", "pitch")}'
        shank += f"{capsule(0.3)}{rod}{foot}</body>"
        thigh = f'<geom type="capsule" fromto="{v(0, 0, 0.15)} {v(0, 0, -0.15)}" size="0.04"/>' + shank
        return (
            chain(f"{side}_hip", hip, (0, y, -0.05), thigh, "yaw", 0.15)
            if "yaw" in hip
            else chain(
                f"{side}_hip", hip, (0, y, -0.05), f'<body name="{side}_femur" pos="{v(0, 0, -0.15)}">{thigh}</body>'
            )
        )

    def arm(side, y):
        finger = "".join(
            f'<body name="{side}_finger{k}" pos="{v(0.01 * k, 0, -0.08)}">{hinge(f"{side}_finger{k}_a", "pitch")}'
            f'{capsule(0.03, 0.008)}<body name="{side}_tip{k}" pos="{v(0, 0, -0.03)}">'
            f"{hinge(f'{side}_finger{k}_b', 'pitch')}{capsule(0.03, 0.008)}</body></body>"
            for k in (0, 1)
        )
        hand = capsule(0.07, 0.02) + finger * fingers
        fore = chain(f"{side}_wrist", wrist, (0, 0, -0.1), hand, "pitch", 0.1)
        elbow = f'<body name="{side}_fore" pos="{v(0, 0, -0.1)}">{hinge(f"{side}_elbow", "pitch")}'
        elbow += f"{capsule(0.2)}{fore}</body>"
        held = chain(f"{side}_shoulder", shoulder, (0, 0, 0), capsule(0.1) + elbow, "yaw", 0.1)
        turn = f"{v(np.sign(y) * spread, -raised, 0)}"
        return f'<body name="{side}_mount" pos="{v(0, y, 0.35)}" euler="{turn}">{held}</body>'

    limbs = leg("left", 0.1) + leg("right", -0.1)
    looks = "".join(
        f'<body name="{side}_eye" pos="{v(0.07, y, 0.12)}">{hinge(f"{side}_looks", "yaw")}{capsule(0, 0.01)}</body>'
        for side, y in (("left", 0.03), ("right", -0.03))
        if eyes
    )
    head = chain("neck", neck, (0, 0, 0.42), f'<geom size="0.08" pos="{v(0, 0, 0.1)}"/>{looks}')
    trunk = (
        f'<geom type="box" size="{v(0.08, 0.14, 0.15)}" pos="{v(0, 0, 0.2)}"/>'
        + head
        + "".join(arm(side, 0.2 if side == "left" else -0.2) for side in arms)
    )
    if hung:
        upper, limbs = trunk, chain("waist", waist, (0, 0, 0.05), '<geom size="0.08"/>' + limbs)
    else:
        upper = chain("waist", waist, (0, 0, 0.05), trunk) if waist else trunk
    acts = "".join(f'<position name="{name}" joint="{name}" kp="50"/>' for name in actuators if "finger" not in name)
    return (
        '<mujoco model="full"><compiler angle="radian" autolimits="true"/><worldbody>'
        f'<body name="base" pos="0 0 0.7"><freejoint/><geom size="0.08"/>{limbs}{upper}</body></worldbody>'
        f"<actuator>{acts}</actuator><equality>{''.join(loops)}</equality></mujoco>"
    )
