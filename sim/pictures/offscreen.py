"""Pictures of a robot without a screen: EGL where it works, else OSMesa, with settings made for software rendering."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

import ctypes
import ctypes.util
import os
import sys
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.rotations import Array
from motiondeck_base.errors import MotiondeckError
from sim.models.scenery import body_height

Image = NDArray[np.uint8]

AZIMUTH = 145.0
ELEVATION = -12.0
# The camera stands this many body heights away and looks at a point this much of a body height above the ground.
DISTANCE = 1.8
LOOK_HEIGHT = 0.48
# A share of the way to the root that the camera goes with each picture: it follows without copying every sway.
FOLLOW = 0.5

INSTALL = (
    "no off-screen OpenGL found. Install EGL (Debian: apt install libegl1 libgl1 libgl1-mesa-dri) or OSMesa "
    "(Debian: apt install libosmesa6)."
)


class PictureError(MotiondeckError):
    """A picture that cannot be made here; the message says what is missing."""


class OffScreen:
    """Draws one model into images; a context manager, because OpenGL wants to be let go in order.

    Args:
        model: the robot on its stage.
        size: width and height of the images, pixels; within the model's off-screen buffer (1920 x 1080).
        shadows: costs about as much again as everything else.

    Raises:
        PictureError: where there is no off-screen OpenGL, or the size does not fit.
    """

    def __init__(self, model: mujoco.MjModel, size: tuple[int, int] = (640, 480), shadows: bool = False) -> None:
        width, height = size
        most = (int(model.vis.global_.offwidth), int(model.vis.global_.offheight))
        if not (0 < width <= most[0] and 0 < height <= most[1]):
            raise PictureError(f"a picture of {width} x {height} pixels: choose 1 x 1 to {most[0]} x {most[1]}")
        self._gl: Any = _open_context(width, height)
        self._gl.make_current()
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._model, self._data = model, mujoco.MjData(model)
        self._scene = mujoco.MjvScene(model, maxgeom=2 * model.ngeom + 100)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._option = mujoco.MjvOption()
        self._rect = mujoco.MjrRect(0, 0, width, height)
        self._pixels = np.empty((height, width, 3), dtype=np.uint8)
        height = body_height(model)
        self.camera = mujoco.MjvCamera()
        self.camera.type = mujoco.mjtCamera.mjCAMERA_FREE  # pyright: ignore[reportAttributeAccessIssue]
        self.camera.azimuth, self.camera.elevation = AZIMUTH, ELEVATION
        self.camera.distance = DISTANCE * height
        self._look_height = LOOK_HEIGHT * height
        self._following = False

    def draw(self, qpos: Array, cut: bool = False) -> Image:
        """The robot at qpos, shape (height, width, 3); the camera follows its root, or jumps to it at a cut."""
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        here = np.array([qpos[0], qpos[1], self._look_height])
        share = FOLLOW if self._following and not cut else 1.0
        self.camera.lookat[:] = (1.0 - share) * self.camera.lookat + share * here
        self._following = True
        every = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, self._data, self._option, None, self.camera, every, self._scene)
        self._gl.make_current()
        mujoco.mjr_render(self._rect, self._scene, self._context)
        mujoco.mjr_readPixels(self._pixels, None, self._rect, self._context)
        return np.flipud(self._pixels).copy()

    def close(self) -> None:
        """Frees the OpenGL context; may be called twice."""
        if self._gl is not None:
            self._context.free()
            self._gl.free()
            self._gl = None

    def __enter__(self) -> OffScreen:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _open_context(width: int, height: int) -> Any:
    """An OpenGL context of the first library that works; MUJOCO_GL overrules the choice."""
    if not sys.platform.startswith("linux"):
        return mujoco.GLContext(width, height)
    wish = os.environ.get("MUJOCO_GL", "").lower()
    # PyOpenGL binds to one library for the life of the process, so look before it is imported.
    use_egl = wish == "egl" or (wish != "osmesa" and _egl_device_works())
    try:
        if use_egl:
            from mujoco.egl import GLContext
        else:
            from mujoco.osmesa import GLContext
        return GLContext(width, height)
    # Each library fails in its own way when a driver is missing: import, attribute, OS and OpenGL errors were seen.
    except Exception as error:
        raise PictureError(INSTALL) from error


def _egl_device_works() -> bool:
    """Whether libEGL is there and one of its devices gives a display."""
    try:
        egl = ctypes.CDLL(ctypes.util.find_library("EGL") or "libEGL.so.1")
        if ctypes.util.find_library("GL") is None:
            return False
        egl.eglGetProcAddress.restype = ctypes.c_void_p
        egl.eglInitialize.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
        query = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
        get_display = egl.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
    except (OSError, AttributeError):
        return False
    if not (query and get_display):
        return False
    devices, found = (ctypes.c_void_p * 16)(), ctypes.c_int(0)
    ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(query)(
        16, ctypes.addressof(devices), ctypes.addressof(found)
    )
    display_of = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p)(get_display)
    platform_device = 0x313F
    displays = [display_of(platform_device, device, None) for device in devices[: found.value]]
    return any(display and egl.eglInitialize(display, None, None) for display in displays)
