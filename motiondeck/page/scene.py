"""The scene of the page: the robot, its shadow and the floor it walks on."""

from collections.abc import Sequence
from copy import copy
from typing import Self

import mujoco
import numpy as np
import viser
from numpy.typing import NDArray

from controller.motion.rotations import Array, conjugate, multiply
from motiondeck.page.body.drawn_model import DrawnModel, linear
from motiondeck.page.web.private_page import PrivatePage
from sim.models.scenery import LABEL, body_height

# Of zenith and horizon, and of the floor's squares; in a browser that is dark, and otherwise.
DARK = ((14, 17, 21), (40, 45, 52)), ((52, 58, 66), (42, 47, 54))
LIGHT = ((214, 225, 238), (242, 245, 248)), ((214, 220, 228), (190, 199, 210))
SQUARES = 36
# Where one looks from, in heights of the robot that faces +x, and the height that one looks at.
CAMERAS = {
    "three": ((1.75, -1.05, 0.80), 0.46),
    "front": ((2.15, 0.0, 0.60), 0.46),
    "side": ((0.0, -2.15, 0.60), 0.46),
    "top": ((0.0, -0.01, 2.60), 0.0),
}
USUAL = "three"
# On a page narrower than this share of its height, a phone's, the panel covers the lower half: there the camera stands
# farther away by the factor, and lower by the heights, below, which puts the robot into the upper half.
PHONE, PHONE_DISTANCE, PHONE_LOWER = 0.8, 2.0, 0.85
LIES = 0.5  # of what points forward: as little is horizontal of it, at most, when the body lies
TELEPORT = 3.0  # m: too far to have been walked between two pictures


class Follower:
    """The point on the ground that the view is centred on: it follows the root without its sway."""

    def __init__(self) -> None:
        self._position: Array | None = None
        self._velocity = np.zeros(2)

    def follow(self, root: Array, dt: float) -> Array:
        """The centre after dt seconds for a root at (2,), m: an alpha-beta filter, so a steady walk has no lag."""
        if self._position is None or np.linalg.norm(root - self._position) > TELEPORT:
            self._position, self._velocity = root.copy(), np.zeros(2)
            return root
        share = 1.0 - np.exp(-4.0 * dt)
        ahead = self._position + self._velocity * dt
        miss = root - ahead
        centre: Array = ahead + share * miss
        self._position = centre
        self._velocity = self._velocity + share**2 / (2.0 - share) * miss / max(dt, 1e-3)
        return centre


class Scene:
    """A robot on a page, with a camera that moves along."""

    def __init__(self, page: PrivatePage, model: mujoco.MjModel) -> None:
        self._page: PrivatePage | viser.ClientHandle = page
        self.height = height = body_height(model)  # m
        self._cell = 0.25 if height < 1.0 else 1.0
        scene = page.scene
        scene.set_up_direction("+z")
        # Cheap enough for a browser without a graphics card: two lights, one shadow, no environment map and no grid.
        scene.configure_default_lights(enabled=False)
        scene.configure_environment_map(None)
        scene.add_light_hemisphere("/light/sky", sky_color=(255, 255, 255), ground_color=(150, 155, 165), intensity=2.4)
        scene.add_light_directional("/light/sun", intensity=2.6, position=(1.2 * height, -1.6 * height, 4.0 * height))
        self._floor = scene.add_frame("/floor", show_axes=False)
        self._surround(scene, dark=False)
        page.suit = self.suit
        self._suited: dict[int, tuple[bool, bool]] = {}  # by browser: whether it is dark, and sees the scene as a whole
        self.robot = DrawnModel(page, model, height)
        self.data = self.robot.data  # MuJoCo's state of the robot as it is shown
        self._rest = self.data.xquat[1].copy()
        for site in filter(lambda site: site.name.startswith(LABEL), map(model.site, range(model.nsite))):
            text, place = site.name.removeprefix(LABEL), self.data.site(site.name).xpos
            scene.add_label(f"/{site.name}", text, position=place, font_screen_scale=0.8, anchor="top-center")
        page.initial_camera.position, page.initial_camera.look_at = self._camera(USUAL)
        page.initial_camera.fov = np.radians(42.0)

        @page.on_client_connect
        def _(client: viser.ClientHandle) -> None:
            was = [False]

            @client.camera.on_update
            def turned(camera: viser.CameraHandle) -> None:
                if self._is_narrow(client) != was[0]:
                    was[0] = not was[0]
                    self.look_from(client, USUAL)

            turned(client.camera)

    def _is_narrow(self, client: viser.ClientHandle) -> bool:
        return client.camera.aspect < PHONE and not self._suited.get(client.client_id, (False, False))[1]

    def suit(self, client: viser.ClientHandle, look: tuple[bool, bool] | None = None) -> None:
        """Draws for one browser, dark or not, with the scene seen as a whole or behind a sheet; else as before."""
        was_dark, was_whole = was = self._suited.get(client.client_id, (False, False))
        self._suited[client.client_id] = dark, whole = look or was
        if dark or was_dark:
            self._surround(client.scene, dark=dark)
            for whose in ("", " follower", " human"):  # a shadow would be brighter than a dark floor
                client.scene.add_frame(f"/shadow{whose}", show_axes=False, visible=not dark)
        if whole != was_whole:
            self.look_from(client, USUAL)

    def _surround(self, scene: viser.SceneApi, *, dark: bool) -> None:
        """Draws sky, fog and floor, for all browsers or for one."""
        (zenith, horizon), floor = DARK if dark else LIGHT
        fog = tuple(linear(np.array(horizon)).tolist())  # it comes out of the lights as the horizon
        scene.set_background_image(_sky(zenith, horizon), format="png")
        scene.configure_fog(near=3.0 * self.height, far=9.0 * self.height, color=fog)
        for parity, colour in enumerate(floor):
            scene.add_mesh_simple(f"/floor/{parity}", *_tiles(self._cell, parity), color=colour, flat_shading=True)

    def twin(self, client: viser.ClientHandle) -> Self:
        """The robot on its floor for one browser, which sees it in place of this one."""
        twin = copy(self)
        twin._page, twin.robot = client, self.robot.twin(client)
        twin._floor = client.scene.add_frame("/floor", show_axes=False)
        return twin

    def _camera(self, way: str, heading: float = 0.0) -> tuple[Array, Array]:
        """Where a camera stands and what it looks at, m, for a robot that faces a heading, rad."""
        (x, y, z), aim = CAMERAS[way]
        cosine, sine = np.cos(heading), np.sin(heading)
        place = np.array([cosine * x - sine * y, sine * x + cosine * y, z])
        return self.height * place, np.array([0.0, 0.0, self.height * aim])

    def look_from(self, client: viser.ClientHandle, way: str) -> None:
        """Has one browser look from one of CAMERAS: the usual one, or as the robot faces now.

        What is drawn beside the robot stands where the usual one sees it.
        """
        place, aim = self._camera(way, facing(self.data.xquat[1], self._rest) if way != USUAL else 0.0)
        if self._is_narrow(client):
            down = np.array([0.0, 0.0, PHONE_LOWER * self.height]) if way != "top" else np.zeros(3)
            place, aim = aim + PHONE_DISTANCE * (place - aim) - down, aim - down
        with client.atomic():
            client.camera.position, client.camera.look_at = place, aim

    def show(self, qpos: Array, centre: Array) -> None:
        """Draws the robot at qpos (nq,), relative to the centre (2,) of the view, m."""
        with self._page.atomic():
            self.robot.show(qpos, centre)
            # Moving the floor back by less than two squares looks like walking on.
            self._floor.position = (*(-np.mod(centre, 2.0 * self._cell)), 0.0)


def facing(turned: Array, rest: Array) -> float:
    """The heading of a body, rad, of its rotation (4,) and that in which it faces along x (4,)."""
    # It is that of what points forward at rest; of a body that lies, that of what points up then: its head.
    axes = np.empty(9)
    mujoco.mju_quat2Mat(axes, multiply(turned, conjugate(rest)))
    forward, _, up = axes.reshape(3, 3).T
    x, y, _ = forward if np.hypot(*forward[:2]) > LIES else up
    return float(np.arctan2(y, x))


def _tiles(cell: float, parity: int) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Every other square of a chequered floor, as triangles."""
    half = SQUARES // 2
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    squares = [(x, y) for x in range(-half, half) for y in range(-half, half) if (x + y) % 2 == parity]
    flat = cell * (np.array(squares)[:, None, :] + corners).reshape(-1, 2)
    first = 4 * np.arange(len(squares))[:, None]
    faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    return np.column_stack([flat, np.zeros(len(flat))]).astype(np.float32), faces.astype(np.uint32)


def _sky(zenith: Sequence[int], horizon: Sequence[int], height: int = 256) -> NDArray[np.uint8]:
    """A picture (height, 2, 3): the colour of the horizon, and above its middle up to that of the zenith."""
    up = np.clip(np.linspace(1.0, -1.0, height), 0.0, 1.0)[:, None, None]
    mixed = up * np.array(zenith) + (1.0 - up) * np.array(horizon)
    return np.broadcast_to(mixed, (height, 2, 3)).astype(np.uint8)
