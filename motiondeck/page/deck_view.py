"""What the page shows of a deck: the robot and who stands beside it, the panel, the rig and the last minutes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import viser

from controller.motion.rotations import Array
from controller.wire.command_socket import CommandClient
from controller.wire.messages.events import Event
from motiondeck.page.body.body_push import BodyPush
from motiondeck.page.body.drawn_model import DrawnModel
from motiondeck.page.body.live_footprints import LiveSteps
from motiondeck.page.body.live_forces import LiveForces
from motiondeck.page.body.target_pose import TargetPose
from motiondeck.page.ghost import Ghost
from motiondeck.page.learning.hand_recorder import HandRecorder
from motiondeck.page.learning.learn_panel import LearnPanel
from motiondeck.page.network.network_view import NetworkView
from motiondeck.page.panel import Panel
from motiondeck.page.rig.joint_glow import JointGlow
from motiondeck.page.rig.rig_panel import RigPanel
from motiondeck.page.rig.servo_tables import looks_through
from motiondeck.page.scene import Follower, Scene
from motiondeck.page.timeline import Timeline
from motiondeck.page.web.private_page import PrivatePage
from motiondeck.page.web.state_line import RunState, number_in
from motiondeck_base.errors import FileFormatError
from sim.models.formats.urdf_visuals import with_visuals

HEALTH_PER_SECOND = 4.0
BESIDE = 0.6  # of the robot's height: so far aside a follower, or the human, is drawn
LONGEST_STEP = 0.1  # s that pass for the camera between two pictures, however late the second is
SIDE_WIDTH = 340  # pixels


class DeckView:
    """All that is on the page of a deck.

    Args:
        page: where it is put.
        description: what the deck says of itself in its state file.
        commands: to the deck.
        looks: to the deck too, for what takes it a while to answer.
        dropped: the folder where dropped recordings are kept.

    Raises:
        FileFormatError: if MuJoCo refuses a model file of the deck.
    """

    def __init__(
        self,
        page: PrivatePage,
        description: Mapping[str, Any],
        commands: CommandClient,
        looks: CommandClient,
        dropped: Path,
    ):
        self._page = page
        self._motions = [str(motion) for motion in description["motions"]]
        model_file, push_ns = str(description["model_file"]), float(description.get("push_ns", 0.0))
        model = _model(model_file)
        self._scene = Scene(page, model)
        height = self._scene.height
        files = [str(file) for file in description.get("followers", ())]
        self._followers = [DrawnModel(page, _model(file), height, f" {k}") for k, file in enumerate(files)]
        self._ghost = None
        if about := description.get("human"):
            human = _model(str(about["file"]))
            # Followers stand to the right of the robot, on the side that the panel does not cover.
            aside = (BESIDE if files else -BESIDE) * height
            self._ghost = Ghost(DrawnModel(page, human, height, " human"), human, about, aside)
        self._steps = LiveSteps(page, model, np.array(description.get("rest", model.qpos0)), height)
        weight = description.get("weight")
        self._forces = LiveForces(page, float(weight), height) if weight else None
        self._target = TargetPose(page, lambda: _model(model_file), height) if description.get("has_target") else None
        self._panel = Panel(
            page,
            self._motions,
            [str(joint) for joint in description.get("joints", ())],
            commands,
            look_from=self._scene.look_from,
            has_human=self._ghost is not None,
            has_phase=bool(description.get("has_phase")),
            has_network=bool(description.get("library")),
            push_ns=push_ns,
            has_forces=self._forces is not None,
            has_target=self._target is not None,
            library=Path(file) if (file := description.get("library_file")) else None,
            direct=bool(description.get("direct")),
            recognizable=description.get("recognizable", ()),
        )
        library = description.get("library")
        self._network = NetworkView(page, self._panel.parts, Path(str(library)), height) if library else None
        if push_ns:
            BodyPush(self._scene.robot, height, push_ns, self._panel.send)
        self._add_side(model, description, looks, dropped)
        self._follower, self._centre = Follower(), np.zeros(2)
        self._last_picture = self._last_health = 0.0

    def _add_side(
        self, model: mujoco.MjModel, description: Mapping[str, Any], looks: CommandClient, dropped: Path
    ) -> None:
        """Puts the servos and the learning of new motions on the left, and the last minutes below."""
        gui, parts = self._page.gui, self._panel.parts
        servos, learn = description.get("rig"), description.get("learn")
        self._rig = self._glow = self._hands = None
        side = gui.add_panel() if servos or learn else None
        if side is not None and servos:
            with side.add_tab("Rig", viser.Icon.ENGINE):
                look = looks_through(looks, self._panel.refuse)
                self._rig = RigPanel(self._page, parts, servos, self._panel.ask, look)
            joints = [servo["joint"] for servo in servos["servos"]]
            self._glow = JointGlow(self._page, model, joints, self._scene.height)
        if side is not None and learn:
            with side.add_tab("Learn", viser.Icon.SCHOOL):
                ask, library = self._panel.ask, Path(description["library_file"])
                learning = LearnPanel(self._page, parts, learn, library, dropped, ask)
                if servos:
                    self._hands = HandRecorder(
                        self._page, parts, servos, dropped, ask, self._panel.send, learning.look_at
                    )
        self._timeline = Timeline(parts)
        if side is not None:
            side.dock_left()
            side.set_width(SIDE_WIDTH)
            side.expand()  # on a phone it stands below the rest, closed at first otherwise

    def show(self, latest: dict[str, Array], now: float) -> None:
        """Draws a published state at a time, s; or, while someone looks back, what was shown then."""
        playing = self._motions[int(latest["playing"][0])] if "playing" in latest else ""
        self._timeline.keep(latest, RunState.of(latest, self._motions).shown, now)
        if self._page.get_clients():  # drawing for nobody costs as much
            self._draw(self._timeline.seen(latest), latest, playing, min(now - self._last_picture, LONGEST_STEP))
        self._last_picture = now
        if self._hands is not None:
            self._hands.see(latest)
        if now - self._last_health < 1.0 / HEALTH_PER_SECOND:
            return
        self._last_health = now
        self._panel.show(latest)
        self._timeline.show()
        if self._hands is not None:
            self._hands.show()
        if self._rig is not None and self._glow is not None:
            self._glow.mark(self._rig.show(latest, now), self._scene.data, self._centre)

    def _draw(self, seen: Mapping[str, Array], latest: Mapping[str, Array], playing: str, dt: float) -> None:
        """Draws the bodies of one state, and the network and the rig as they are now, dt seconds after the last."""
        view = self._panel.view
        if view.follows:
            self._centre = self._follower.follow(seen["qpos"][:2], dt)
        centre = self._centre
        with self._page.atomic():  # one message for all of it
            self._scene.show(seen["qpos"], centre)
            beside = np.array([0.0, -BESIDE * self._scene.height])
            for k, other in enumerate(self._followers):
                qpos = seen[f"qpos {k}"].copy()
                qpos[:2] = seen["qpos"][:2] + (k + 1) * beside
                other.show(qpos, centre)
            if self._ghost is not None:
                self._ghost.show(view.human, seen["human_root"], seen["human_turn"], seen["qpos"][:2], centre)
            if self._target is not None:
                self._target.show(seen["target"], centre, visible=view.target)
            if self._network is not None:
                phase = number_in(latest, "phase", float("nan"))
                self._network.show(latest.get("activation"), playing, phase, visible=view.network)
            self._steps.show(self._scene.data, centre, dt, visible=view.steps)
            if self._forces is not None:
                self._forces.show(seen["contacts"].reshape(-1, 6), centre, visible=view.forces)
            if self._glow is not None:
                self._glow.show(self._scene.data, centre)

    @property
    def recording(self) -> bool:
        """Whether the rig is being recorded by hand, and `record` wants every state."""
        return self._hands is not None and self._hands.recording

    def record(self, state: Mapping[str, Array]) -> None:
        """Takes a published state for the recording by hand."""
        if self._hands is not None:
            self._hands.record(state)

    def tell(self, event: Event) -> None:
        """Shows an event of the deck."""
        self._panel.tell(event)
        self._timeline.tell(event)

    def end(self, reason: str) -> None:
        """Shows that the run has ended, and why."""
        self._panel.end(reason)


def _model(file: str) -> mujoco.MjModel:
    try:
        return with_visuals(mujoco.MjSpec.from_file(file))
    except ValueError as error:
        raise FileFormatError(f"{file}: MuJoCo refuses it: {error}") from error
