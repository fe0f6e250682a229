"""The drawing of a robot on the page of an export, as plain values that `web/scene.js` puts together."""

from base64 import b64encode
from typing import Any

import mujoco
import numpy as np

from controller.motion.rotations import Array
from motiondeck.page.body.solids import batches
from sim.models.joint_layout import JointLayout
from sim.models.scenery import LABEL, body_height

MOST_TRIANGLES = 800  # of a mesh: less than on the live page, since the folder is sent to others
BODIES = ("body_parentid", "body_pos", "body_quat", "jnt_type", "jnt_bodyid", "jnt_qposadr", "jnt_axis", "jnt_pos")
SHAPES = ("qpos0", "geom_bodyid", "geom_pos", "geom_quat", "site_bodyid", "site_pos")


def drawn_figure(model: mujoco.MjModel, layout: JointLayout) -> dict[str, Any]:
    """The drawing of a model of hinges: arrays of the model by their names, and what is drawn, by shape."""
    led = [
        (int(follower), int(leader), curve.tolist())
        for group, followers, leaders in zip(layout.led, layout.followers, layout.leaders, strict=True)
        for follower, leader, curve in zip(followers, leaders, group.curve, strict=True)
    ]
    shapes = [
        {
            "vertices": _packed(batch.mesh[0].astype("<f4")),
            "faces": _packed(batch.mesh[1].astype("<u2")),
            "opacity": batch.opacity,
            **{name: _listed(getattr(batch, name)) for name in ("geom", "offset", "scale", "colour")},
        }
        for batch in batches(model, MOST_TRIANGLES).values()
    ]
    sites = [model.site(site).name for site in range(model.nsite)]
    labels = [name.removeprefix(LABEL) if name.startswith(LABEL) else "" for name in sites]
    joints = {"hinge": layout.hinge.tolist(), "hinge_qpos": layout.hinge_qpos.tolist(), "led": led}
    return {
        **{name: _listed(getattr(model, name)) for name in BODIES + SHAPES},
        **{**joints, "shapes": shapes, "labels": labels, "height": body_height(model)},
    }


def _listed(values: Array) -> list[Any]:
    return np.round(values, 6).tolist()


def _packed(values: Array) -> str:
    return b64encode(values.tobytes()).decode()
