"""Scenery of every robot: floor, light, sky, and the gantry that carries its root."""

import mujoco

GANTRY = "(gantry)"
FLOOR = "(floor)"
LABEL = "(name) "  # goes before a joint's name in the name of the site where a page writes it

TIMESTEP = 0.0025
HORIZON = (0.80, 0.85, 0.90)


def set_stage(spec: mujoco.MjSpec, height: float) -> None:
    """Adds a chequered floor at z = 0, a sky and soft light from above, and the settings of a fast off-screen picture.

    The floor has no contacts, which would fight the gantry; the height of the root, m, scales its squares.
    """
    spec.option.timestep = TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Without contacts the few constraints converge in a step or two; the cap keeps a bad tick short.
    spec.option.iterations = 20
    spec.visual.quality.offsamples = 0
    spec.visual.quality.shadowsize = 2048
    spec.visual.global_.offwidth = 1920
    spec.visual.global_.offheight = 1080
    spec.visual.headlight.ambient = [0.40, 0.40, 0.42]
    spec.visual.headlight.diffuse = [0.28, 0.28, 0.28]
    spec.visual.headlight.specular = [0.0, 0.0, 0.0]
    spec.visual.rgba.haze = [*HORIZON, 1.0]

    sky = spec.add_texture(name="(sky)", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=64, height=384)
    sky.builtin, sky.rgb1, sky.rgb2 = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, [0.93, 0.95, 0.97], list(HORIZON)
    ground = spec.add_texture(name=FLOOR, type=mujoco.mjtTexture.mjTEXTURE_2D, width=256, height=256)
    # Under all lamps together this comes out at four fifths of white.
    ground.builtin, ground.rgb1, ground.rgb2 = mujoco.mjtBuiltin.mjBUILTIN_CHECKER, [0.6, 0.63, 0.66], [0.53, 0.56, 0.6]
    ground.mark, ground.markrgb = mujoco.mjtMark.mjMARK_EDGE, [0.66, 0.69, 0.72]
    floor = spec.add_material(name=FLOOR, texrepeat=[0.9 / height] * 2, texuniform=True, reflectance=0.0, specular=0.0)
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = FLOOR
    plane = spec.worldbody.add_geom(name=FLOOR, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05])
    plane.material, plane.contype, plane.conaffinity = FLOOR, 0, 0

    # Even light far out; the shadow is the lamp's.
    day = spec.worldbody.add_light(name="(day)", type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, castshadow=False)
    day.pos, day.dir, day.diffuse, day.specular = [0, 0, 10], [-0.2, 0.5, -1], [0.36, 0.36, 0.37], [0, 0, 0]


def add_lamp(root: mujoco.MjsBody, height: float) -> None:
    """Adds a lamp that follows the root, so that the shadow stays sharp; the root's height, m, scales its distance."""
    at = [0.4 * height, -1.5 * height, 3.8 * height]
    lamp = root.add_light(name="(lamp)", type=mujoco.mjtLightType.mjLIGHT_SPOT, cutoff=80.0, exponent=0.0)
    lamp.mode, lamp.pos, lamp.dir = mujoco.mjtCamLight.mjCAMLIGHT_TRACK, at, [-component for component in at]
    lamp.attenuation, lamp.diffuse, lamp.specular = [1.0, 0.0, 0.0], [0.36, 0.35, 0.33], [0.2, 0.2, 0.2]


def add_gantry(spec: mujoco.MjSpec, root: mujoco.MjsBody) -> None:
    """Adds a commanded body (mocap) and a weld that pulls the robot's free root along."""
    spec.worldbody.add_body(name=GANTRY, mocap=True, pos=root.pos)
    weld = spec.add_equality(name=GANTRY, type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY)
    weld.name1, weld.name2 = GANTRY, root.name
    weld.solref, weld.solimp = [2.0 * TIMESTEP, 1.0], [0.95, 0.99, 0.001, 0.5, 2.0]
    # Anchor, relative pose and torque scale; an all-zero relative quaternion would mean "as in the initial pose".
    weld.data[:11] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]


def body_height(model: mujoco.MjModel) -> float:
    """Height of a robot in its initial pose, m."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    moving = model.body_weldid[model.geom_bodyid] != 0
    return float((data.geom_xpos[moving, 2] + model.geom_rbound[moving]).max()) if moving.any() else 1.0
