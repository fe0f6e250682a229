"""The folder "view" of the panel: what is drawn besides the robot, and the camera."""

from collections.abc import Callable
from typing import NamedTuple

import viser

from motiondeck.page.ghost import WAYS
from motiondeck.page.scene import CAMERAS
from motiondeck.page.web.page_state import PageDescription
from motiondeck.page.web.private_page import PrivatePage

TARGET = "The pose that the servos are to reach, translucent"
FORCES = "Of the floor on the body; an arrow half as long as the robot is its weight"
NETWORK = "The orbits of its neurons, in the three directions that show most"


class View(NamedTuple):
    """What is drawn besides the robot, and how."""

    human: str  # where
    target: bool  # the pose that the servos are to reach
    network: bool
    steps: bool  # prints and contacts of the feet
    forces: bool  # of the floor on the body
    follows: bool  # whether the camera follows the robot


class ViewChoices:
    """The choices of the viewer, as far as the run has something to show; `look_from` moves the camera of a browser."""

    def __init__(
        self, page: PrivatePage, look_from: Callable[[viser.ClientHandle, str], None], about: PageDescription
    ) -> None:
        gui = page.gui
        human, forces = about.human is not None, about.weight is not None
        with gui.add_folder("view", expand_by_default=False):
            self._human = gui.add_dropdown("human", WAYS, hint="The pose that the network plays") if human else None
            self._boxes = (
                gui.add_checkbox("target pose", False, hint=TARGET) if "target" in about.shapes else None,
                gui.add_checkbox("network", False, hint=NETWORK) if about.has_network else None,
                gui.add_checkbox("footprints and contacts", False) if about.walks else None,
                gui.add_checkbox("contact forces", False, hint=FORCES) if forces else None,
                gui.add_checkbox("camera follows", True) if about.walks else None,
            )
            cameras = gui.add_button_group("camera", tuple(CAMERAS))

        @cameras.on_click
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None:  # the browser that pressed it
                look_from(event.client, str(cameras.value))

    @property
    def now(self) -> View:
        """What is chosen now."""
        human = str(self._human.value) if self._human is not None else WAYS[0]
        return View(human, *(box is not None and bool(box.value) for box in self._boxes))
