"""Draws models off screen: with EGL where it works, else OSMesa, tuned for software rendering."""

import copy
import ctypes
import ctypes.util
import os
import sys
from collections.abc import Sequence
from typing import Any, Literal, Self, get_args

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pictures
from PIL import ImageFilter

from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError
from sim.models.scenery import body_height

Image = NDArray[np.uint8]
Camera = Literal["follow", "front", "side", "three"]
CAMERAS: tuple[Camera, ...] = get_args(Camera)

# Which way a camera looks, degrees about z from x: follow from ahead and aside, front and side straight on.
AZIMUTH: dict[str, float] = {"follow": 145.0, "front": 180.0, "side": 90.0}
ELEVATION = -12.0
# In body heights: what a picture is high and wide at the least, and how far its middle is above the ground.
HIGH, WIDE, LOOK_HEIGHT = 1.5, 1.4, 0.55
# A share of the way to the root that the camera goes with each picture: it follows without copying every sway.
FOLLOW = 0.5
# How much the meshes may lose, pixels; how much an edge that is smoothed stands out, of 255.
DETAIL, EDGE = 2.0, 60
GHOST, PRINT = (0.35, 0.6, 0.85, 0.35), (0.24, 0.28, 0.34, 1.0)
LARGE = 400  # rows of a picture that is large enough to be smoothed

INSTALL = "no off-screen OpenGL found. On Debian: apt install libegl1 libgl1 libgl1-mesa-dri, or libosmesa6."


class OffScreen:
    """Draws one or more robots of one model into images; a context manager, because OpenGL contexts are freed in order.

    The size, pixels, is within the model's off-screen buffer (1920 x 1080). Shadows double the cost. The camera "three"
    divides the image into the views of the other three. MotiondeckError without off-screen OpenGL, or for a wrong size.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        size: tuple[int, int] = (640, 480),
        shadows: bool = False,
        camera: Camera = "follow",
    ) -> None:
        width, height = size
        most = (int(model.vis.global_.offwidth), int(model.vis.global_.offheight))
        if not (0 < width <= most[0] and 0 < height <= most[1]):
            raise MotiondeckError(f"a picture of {width} x {height} pixels: choose 1 x 1 to {most[0]} x {most[1]}")
        self._tall = body_height(model)
        drawn = with_less_detail(model, DETAIL * HIGH * self._tall / height) if model.nmesh else model
        self._gl: Any = _open_context(width, height)
        self._gl.make_current()
        self._context = mujoco.MjrContext(drawn, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._model, self._data, self._other = model, mujoco.MjData(model), mujoco.MjData(model)
        self._scene = mujoco.MjvScene(model, maxgeom=3 * model.ngeom + 1000)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._option, self._perturb = mujoco.MjvOption(), mujoco.MjvPerturb()
        self._pixels = np.empty((height, width, 3), dtype=np.uint8)
        names = ("front", "follow", "side") if camera == "three" else (camera,)
        share = width // len(names)
        self._rects = [mujoco.MjrRect(share * k, 0, share, height) for k in range(len(names))]
        self._cameras = [mujoco.MjvCamera() for _ in names]
        for view, name in zip(self._cameras, names, strict=True):
            view.type = mujoco.mjtCamera.mjCAMERA_FREE
            view.azimuth, view.elevation = AZIMUTH[name], ELEVATION
        self._aspect, self._half = share / height, np.tan(0.5 * np.radians(model.vis.global_.fovy))
        free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
        self._roots = model.jnt_qposadr[free] if len(free) else np.zeros(1, np.int64)
        self._middle: Array = np.zeros(2)
        self._aimed = False

    def draw(self, qpos: Array, cut: bool = False, ghost: Array | None = None, prints: Sequence[Array] = ()) -> Image:
        """A picture, (height, width, 3), of the robot at qpos (nq,); the cameras follow it, or jump to it at a cut.

        The robot is also drawn translucent at the ghost (nq,); footprints are corners on the floor, (4, 3) each, m, in
        order around them.
        """
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        if ghost is not None:
            self._other.qpos[:] = ghost
            mujoco.mj_kinematics(self._model, self._other)
        self.follow(qpos, cut)
        self._gl.make_current()
        every = mujoco.mjtCatBit.mjCAT_ALL.value
        for rect, view in zip(self._rects, self._cameras, strict=True):
            mujoco.mjv_updateScene(self._model, self._data, self._option, None, view, every, self._scene)
            if ghost is not None:
                first, moving = self._scene.ngeom, mujoco.mjtCatBit.mjCAT_DYNAMIC.value
                mujoco.mjv_addGeoms(self._model, self._other, self._option, self._perturb, moving, self._scene)
                for geom in self._scene.geoms[first : self._scene.ngeom]:
                    geom.rgba[:] = GHOST
            for corners in prints:
                self._add_print(corners)
            mujoco.mjr_render(rect, self._scene, self._context)
        whole = mujoco.MjrRect(0, 0, self._pixels.shape[1], self._pixels.shape[0])
        mujoco.mjr_readPixels(self._pixels, None, whole, self._context)
        picture = np.flipud(self._pixels).copy()
        if len(picture) >= LARGE:
            for rect in self._rects:  # what moves is in the middle square of a view
                half = min(rect.width, rect.height) // 2
                middle = rect.left + rect.width // 2
                part = picture[:, middle - half : middle + half]
                # Its sharp edges are softened: a tenth of the cost of drawing it several times as large.
                whole = Pictures.fromarray(part)
                edges = whole.convert("L").filter(ImageFilter.FIND_EDGES)
                mask = edges.point([255 if step > EDGE else 0 for step in range(256)])
                part[:] = np.asarray(Pictures.composite(whole.filter(ImageFilter.SMOOTH), whole, mask))
        return picture

    def follow(self, qpos: Array, cut: bool = False) -> None:
        """Points the cameras at the middle of all roots of qpos (nq,), from so far away that all is in the picture."""
        places = np.array([qpos[root : root + 2] for root in self._roots])
        here = 0.5 * (places.min(axis=0) + places.max(axis=0))
        if not self._aimed or cut:
            self._middle, self._aimed = here, True
            apart = float(np.linalg.norm(places.max(axis=0) - places.min(axis=0)))
            for view in self._cameras:
                seen = max(HIGH * self._tall, (WIDE * self._tall + apart) / self._aspect)
                view.distance = 0.5 * seen / self._half
        self._middle = middle = (1.0 - FOLLOW) * self._middle + FOLLOW * here
        for view in self._cameras:
            view.lookat[:] = (*middle, LOOK_HEIGHT * self._tall)

    def _add_print(self, corners: Array) -> None:
        scene = self._scene
        if scene.ngeom >= scene.maxgeom:
            return
        along, across = corners[1] - corners[0], corners[3] - corners[0]
        size = np.array([0.5 * np.linalg.norm(along), 0.5 * np.linalg.norm(across), 0.001 * self._tall])
        ahead = along / max(float(np.linalg.norm(along)), 1e-9)
        axes = np.array([[ahead[0], -ahead[1], 0.0], [ahead[1], ahead[0], 0.0], [0.0, 0.0, 1.0]])
        geom, middle = scene.geoms[scene.ngeom], corners.mean(axis=0)
        mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_BOX, size, middle, axes.ravel(), np.array(PRINT, np.float32))
        geom.category = mujoco.mjtCatBit.mjCAT_DECOR.value
        scene.ngeom += 1

    def close(self) -> None:
        """Frees the OpenGL context; may be called twice."""
        if self._gl is not None:
            self._context.free()
            self._gl.free()
            self._gl = None

    def __enter__(self) -> Self:
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
        raise MotiondeckError(INSTALL) from error


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


def with_less_detail(model: mujoco.MjModel, finest: float) -> mujoco.MjModel:
    """A copy of a model for drawing only, whose meshes have no detail finer than `finest` m."""
    # Vertices within one cell of a grid become one of them, without empty triangles (Rossignac and Borrel 1993).
    drawn = copy.copy(model)
    for mesh in range(drawn.nmesh):
        first, count = drawn.mesh_vertadr[mesh], drawn.mesh_vertnum[mesh]
        start, end = drawn.mesh_faceadr[mesh], drawn.mesh_faceadr[mesh] + drawn.mesh_facenum[mesh]
        cells = np.floor(drawn.mesh_vert[first : first + count] / finest).astype(np.int64)
        _, chosen, cell = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        faces = chosen[cell.ravel()][drawn.mesh_face[start:end]]
        a, b, c = faces.T
        kept = (a != b) & (b != c) & (a != c)
        left = int(kept.sum())
        if left == 0:  # smaller than a cell as a whole
            continue
        drawn.mesh_face[start : start + left] = faces[kept]
        for corners in (drawn.mesh_facenormal, drawn.mesh_facetexcoord):
            corners[start : start + left] = corners[start:end][kept]
        drawn.mesh_facenum[mesh] = left
    return drawn
