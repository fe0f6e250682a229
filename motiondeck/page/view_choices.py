"""The folder "view" of the panel: what is drawn besides the robot, and the camera."""

from __future__ import annotations

from collections.abc import Callable

import viser

from motiondeck.page.ghost import WAYS
from motiondeck.page.scene import CAMERAS
from motiondeck.page.web.page_state import PageDescription
from motiondeck.page.web.private_page import PrivatePage

TARGET = "The pose that the simulated servos are to reach, translucent"
FORCES = "Of the floor on the body; an arrow half as long as the robot is its weight"
NETWORK = "The orbits of its neurons, in the three directions that show most"


class ViewChoices:
    """The choices of the viewer, as far as the run has something to show; `look_from` moves the camera of a browser."""

    def __init__(
        self, page: PrivatePage, look_from: Callable[[viser.ClientHandle, str], None], about: PageDescription
    ) -> None:
        gui = page.gui
        human, forces = about.human is not None, about.weight is not None
        with gui.add_folder("view", expand_by_default=False):
            self._human = gui.add_dropdown("human", WAYS, hint="The pose that the network plays") if human else None
            self._target = gui.add_checkbox("target pose", False, hint=TARGET) if "target" in about.shapes else None
            self._network = gui.add_checkbox("network", False, hint=NETWORK) if about.has_network else None
            self._steps = gui.add_checkbox("footprints and contacts", False)
            self._forces = gui.add_checkbox("contact forces", False, hint=FORCES) if forces else None
            self._follow = gui.add_checkbox("camera follows", True)
            cameras = gui.add_button_group("camera", tuple(CAMERAS))

        @cameras.on_click
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None:  # the browser that pressed it
                look_from(event.client, str(cameras.value))

    @property
    def human(self) -> str:
        """Where the human is shown."""
        return str(self._human.value) if self._human is not None else WAYS[0]

    @property
    def network(self) -> bool:
        """Whether the network is shown beside the body."""
        return self._network is not None and bool(self._network.value)

    @property
    def target(self) -> bool:
        """Whether the pose that the servos are to reach is shown."""
        return self._target is not None and bool(self._target.value)

    @property
    def steps(self) -> bool:
        """Whether prints and contacts of the feet are shown."""
        return bool(self._steps.value)

    @property
    def forces(self) -> bool:
        """Whether the forces of the floor on the body are shown."""
        return self._forces is not None and bool(self._forces.value)

    @property
    def follows(self) -> bool:
        """Whether the camera follows the robot."""
        return bool(self._follow.value)
