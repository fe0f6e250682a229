"""A drawn model: the solids of one robot or human on a page, with their shadow on the floor."""

from copy import copy
from typing import Self

import mujoco
import numpy as np
import viser
from numpy.typing import NDArray

from controller.motion.rotations import Array
from motiondeck.page.body.solids import batches, poses
from motiondeck.page.web.private_page import PrivatePage

SHADOW = (58, 66, 78)
BRIGHTEST = 215  # of 255: pure white has no shading in the light of the scene


class DrawnModel:
    """One robot or one human on a page."""

    def __init__(self, page: PrivatePage, model: mujoco.MjModel, height: float, name: str = "") -> None:
        """Puts it on the page in its initial pose; the height, m, is that of the robot that the scene is made for."""
        self._page, self.model, self._height, self._name = page, model, height, name
        self._found = found = batches(model)
        # Where all copies are is found at once; of each shape it is a part of that.
        self._geom = np.array([geom for batch in found.values() for geom in batch.geom], dtype=np.int64)
        self._offset = np.concatenate([np.empty((0, 3)), *(batch.offset for batch in found.values())])
        ends = np.cumsum([len(batch.geom) for batch in found.values()])
        self._parts = [slice(end - len(batch.geom), end) for end, batch in zip(ends, found.values(), strict=True)]
        self._add_to(page.scene)

    def twin(self, client: viser.ClientHandle) -> Self:
        """A copy for one browser, which sees it in place of this one; its sizes change apart."""
        twin = copy(self)
        twin.model = copy(self.model)
        twin._add_to(client.scene)
        return twin

    def _add_to(self, scene: viser.SceneApi) -> None:
        height, name = self._height, self._name
        self.data = mujoco.MjData(self.model)  # MuJoCo's state of what was shown last
        self._handles: list[tuple[viser.BatchedMeshHandle, viser.BatchedMeshHandle]] = []  # each with its shadow
        mujoco.mj_kinematics(self.model, self.data)
        self._placed = poses(self.model, self.data, self._geom, self._offset)
        for (shape, batch), part in zip(self._found.items(), self._parts, strict=True):
            position, orientation = (of_all[part] for of_all in self._placed)
            # The same solids, flattened, are their own shadow: there is no shadow map for a slow computer to filter.
            looks = (
                ("robot", batch.mesh, linear(np.minimum(batch.colour, BRIGHTEST)), 1.0, 0.0, 1.0),
                ("shadow", batch.shadow, SHADOW, 1e-3, 0.002 * height, 0.5),
            )
            solid, shadow = (
                scene.add_batched_meshes_simple(
                    f"/{look}{name}/{shape}",
                    *mesh,
                    batched_wxyzs=orientation,
                    batched_positions=position,
                    batched_scales=batch.scale,
                    batched_colors=colour,
                    # A shadow of smooth sides would have dark edges, where they are upright.
                    flat_shading=look == "shadow" or not batch.smooth,
                    lod="off",
                    cast_shadow=False,
                    receive_shadow=False,
                    scale=(1.0, 1.0, thickness),
                    position=(0.0, 0.0, lift),
                    opacity=None if batch.opacity == 1.0 else share * batch.opacity,
                )
                for look, mesh, colour, thickness, lift, share in looks
            )
            self._handles.append((solid, shadow))

    @property
    def solids(self) -> list[viser.BatchedMeshHandle]:
        """Its solids on the page, without their shadows."""
        return [solid for solid, _ in self._handles]

    def show(self, qpos: Array, centre: Array) -> None:
        """Draws it at qpos (nq,), as seen by someone at the centre (2,), m."""
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.data)
        self.set_visible(True)
        position, orientation = poses(self.model, self.data, self._geom, self._offset)
        position[:, :2] -= centre
        position, orientation = position.astype(np.float32), orientation.astype(np.float32)
        if all(map(np.array_equal, (position, orientation), self._placed)):
            return
        self._placed = position, orientation
        for part, handles in zip(self._parts, self._handles, strict=True):
            for handle in handles:
                self._page.move_copies(handle, position[part], orientation[part])

    def take_sizes(self) -> None:
        """Draws the solids in the sizes that the model has now."""
        self._found = batches(self.model)
        self._offset = np.concatenate([batch.offset for batch in self._found.values()])
        for handles, batch in zip(self._handles, self._found.values(), strict=True):
            for handle in handles:
                handle.batched_scales = batch.scale.astype(np.float32)

    def set_visible(self, visible: bool) -> None:
        """Hides it until it is shown again, or shows it."""
        for handle in (handle for handles in self._handles for handle in handles):
            handle.visible = visible


def linear(colour: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Screen colours (sRGB) as linear ones, which the page expects for copies."""
    return np.round(255.0 * (colour / 255.0) ** 2.2).astype(np.uint8)
