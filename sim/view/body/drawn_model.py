"""A drawn model: the solids of one robot or human on a page, with their shadow on the floor."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

import mujoco
import numpy as np
import viser
from numpy.typing import NDArray

from controller.rotations import Array
from sim.view.body.solids import batches, poses
from sim.view.web.private_page import PrivatePage

SHADOW = (58, 66, 78)
BRIGHTEST = 215  # of 255: pure white has no shading in the light of the scene


class DrawnModel:
    """One robot or one human on a page.

    Attributes:
        data: MuJoCo's state of what was shown last.
    """

    def __init__(self, page: PrivatePage, model: mujoco.MjModel, height: float, name: str = "") -> None:
        """Puts it on the page in its initial pose.

        Args:
            page: where it is drawn.
            model: of it.
            height: of the robot that the scene is made for, m.
            name: tells it from others.
        """
        self._model, self._visible = model, True
        self.data = mujoco.MjData(model)
        self._batches = batches(model)
        self._handles: dict[str, list[viser.BatchedMeshHandle]] = {}
        mujoco.mj_kinematics(model, self.data)
        for shape, batch in self._batches.items():
            position, orientation = poses(model, self.data, batch)
            # The same solids, flattened, are their own shadow: there is no shadow map for a slow computer to filter.
            looks = (
                ("robot", batch.mesh, _linear(np.minimum(batch.colour, BRIGHTEST)), 1.0, 0.0, 1.0),
                ("shadow", batch.shadow, SHADOW, 1e-3, 0.002 * height, 0.5),
            )
            self._handles[shape] = [
                page.scene.add_batched_meshes_simple(
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
            ]

    @property
    def solids(self) -> list[viser.BatchedMeshHandle]:
        """Its solids on the page, without their shadows."""
        return [solid for solid, _ in self._handles.values()]

    def show(self, qpos: Array, centre: Array) -> None:
        """Draws it at qpos (nq,), as seen by someone at the centre (2,), m."""
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self.data)
        self._set_visible(True)
        for shape, batch in self._batches.items():
            position, orientation = poses(self._model, self.data, batch)
            position[:, :2] -= centre
            positions, orientations = position.astype(np.float32), orientation.astype(np.float32)
            for handle in self._handles[shape]:
                handle.batched_positions, handle.batched_wxyzs = positions, orientations

    def hide(self) -> None:
        """Hides it until it is shown again."""
        self._set_visible(False)

    def _set_visible(self, visible: bool) -> None:
        if visible != self._visible:
            self._visible = visible
            for handle in (handle for handles in self._handles.values() for handle in handles):
                handle.visible = visible


def _linear(colour: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Screen colours (sRGB) as linear ones, which the page expects for copies."""
    return np.round(255.0 * (colour / 255.0) ** 2.2).astype(np.uint8)
