"""Pushing the body with the mouse: press on it, drag, and let go; an arrow shows the push that it will get."""

import math
from collections.abc import Callable
from threading import Thread
from typing import Any

import numpy as np

from controller.motion.rotations import Array
from controller.wire.messages.commands import DeckCommand, Push
from motiondeck.page.body.drawn_model import DrawnModel

COLOUR = (12, 133, 153)
REACH = 0.3  # heights of the robot: so long a drag is a push that a body has to step against
LEAST, MOST = 0.1, 3.0  # of that push: what is less is a slip of the hand
ARROW = "/push"


def pushed(drag: Array, view: Array) -> Array:
    """Where a drag pushes, level, shape (2,), m: to the right as on the screen, and up is away.

    The drag (3,), m, is along the plane that faces the camera; the view (3,) goes from the camera to what it looks at.
    """
    level = math.hypot(view[0], view[1])
    away = np.array([view[0], view[1]]) / level if level > 1e-9 else np.array([0.0, 1.0])
    right = np.array([away[1], -away[0]])
    up = np.cross(np.array([*right, 0.0]), view / max(float(np.linalg.norm(view)), 1e-9))
    way: Array = float(drag[:2] @ right) * right + float(drag @ up) * away
    return way


class BodyPush:
    """Lets browsers push a robot of a height, m; a usual push, N s, is one that it has to step against."""

    def __init__(self, drawn: DrawnModel, height: float, usual: float, send: Callable[[DeckCommand], None]) -> None:
        self._height, self._usual, self._send = height, usual, send
        self._pressed: dict[int, Array] = {}  # where the mouse of each browser was pressed, m
        for solid in drawn.solids:
            solid.on_drag(self._dragged)

    # Of coroutines viser keeps the order; an ordinary function may be called for the end before the beginning.
    async def _dragged(self, event: Any) -> None:
        start, end = np.array(event.start_position), np.array(event.end_position)
        # The start moves along with the body; how far the hand went does not depend on where the body is by now.
        if event.phase == "start":
            self._pressed[event.client_id] = end
        pressed = self._pressed[event.client_id]
        camera = event.client.camera
        way = pushed(end - pressed, np.array(camera.look_at) - np.array(camera.position))
        length = float(np.linalg.norm(way)) / (REACH * self._height)
        scene = event.client.scene
        if event.phase != "end" and length >= LEAST:
            thick = 0.012 * self._height
            tip = start + np.array([*way, 0.0]) * min(1.0, MOST / length)
            scene.add_arrows(
                ARROW,
                np.array([[start, tip]], dtype=np.float32),
                COLOUR,
                shaft_radius=thick,
                head_radius=2.5 * thick,
                head_length=5.0 * thick,
            )
            return
        scene.remove_by_name(ARROW)
        if event.phase == "end" and length >= LEAST:
            impulse = self._usual * min(length, MOST)
            push = Push("back", round(impulse, 3), towards=round(math.atan2(way[1], way[0]), 3))
            Thread(target=self._send, args=(push,), daemon=True).start()  # it waits for the deck's answer
