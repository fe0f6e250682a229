"""Robots made up for tests: a small humanoid as MJCF or URDF, with whatever names, axes and faults a test wants."""

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
