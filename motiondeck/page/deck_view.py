"""The page of a deck: the robot, its follower and the human, the panel, the rig and the last minutes."""

from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import viser

from controller.wire.command_socket import CommandClient
from controller.wire.messages.replies import Event
from motiondeck.page.against_recording import AgainstRecordings
from motiondeck.page.bodies import Bodies
from motiondeck.page.body.body_push import BodyPush
from motiondeck.page.body.live_marks import LiveForces, LiveSteps
from motiondeck.page.event_log import EventLog
from motiondeck.page.event_looks import LOOKS, ROUTINE
from motiondeck.page.learning.hand_recorder import HandRecorder
from motiondeck.page.learning.learn_panel import LearnPanel
from motiondeck.page.network.network_view import NetworkView
from motiondeck.page.network.side_by_side import add_side_by_side
from motiondeck.page.panel import Panel
from motiondeck.page.past import Past
from motiondeck.page.plots import History, add_plots
from motiondeck.page.rig.rig_panel import RigPanel
from motiondeck.page.rig.servo_look import JointGlow
from motiondeck.page.rig.servo_tables import query_servos
from motiondeck.page.scene import Follower
from motiondeck.page.web.page_state import PageDescription, Picture
from motiondeck.page.web.private_page import PrivatePage
from motiondeck.page.web.state_line import shown_motions
from motiondeck_base.errors import FileFormatError
from sim.models.formats.urdf_visuals import with_visuals

HEALTH_PER_SECOND = 4.0
LONGEST_STEP = 0.1  # s that pass for the camera between two pictures, however late the second is
SIDE_WIDTH = 340  # pixels


class DeckView:
    """All that is on a deck's page, recordings kept in `dropped`; FileFormatError if MuJoCo refuses a model file.

    While the rig is recorded by hand, `hands` wants every state.
    """

    def __init__(self, page: PrivatePage, about: PageDescription, commands: CommandClient, dropped: Path) -> None:
        self._page = page
        self._bodies = Bodies.of(page, about, _model)
        self._scene = self._bodies.scene
        height, model = self._scene.height, self._scene.robot.model
        self._steps = LiveSteps(page, model, np.array(about.rest) if about.rest else model.qpos0, height)
        self._forces = LiveForces(page, about.weight, height) if about.weight else None
        self.panel = Panel(
            page, about, commands, look_from=self._scene.look_from, before=lambda: self._past.call_back()
        )
        self._network = None
        if about.network_file:
            self._network = NetworkView(self.panel.parts, Path(about.network_file), height)
        if about.push_ns:
            BodyPush(self._scene.robot, height, about.push_ns, self.panel.send)
        self._add_side(model, about, commands, dropped)
        self._camera, self._centre = Follower(), np.zeros(2)
        self._last_picture = self._last_health = 0.0
        self._commanded: object = None

    def _add_side(self, model: mujoco.MjModel, about: PageDescription, commands: CommandClient, dropped: Path) -> None:
        """Puts the servos and the learning of new motions on the left, and the last minutes below."""
        gui, parts = self._page.gui, self.panel.parts
        rig = about.rig
        self._rig = self._glow = self.hands = None
        self._past = Past(parts, self._bodies)
        self._history = History(about, model)
        side = gui.add_panel() if rig is not None or about.learn else None
        if side is not None and rig is not None:
            with side.add_tab("Rig", viser.Icon.ENGINE):
                look = partial(query_servos, commands, self.panel.refuse)
                self._rig = RigPanel(parts, rig, self.panel.ask, look)
            self._glow = JointGlow(self._page, model, [servo.joint for servo in rig.servos], self._scene.height)
        tab = partial(gui.add_folder, expand_by_default=False) if side is None else side.add_tab
        if about.human is not None and about.library_file and not about.behind_s:
            AgainstRecordings(self._history, Path(about.library_file), about.human.skeleton)
        with tab("Plots"):
            add_plots(parts, self._history, self._past.moment)
        if about.network_file and about.library_file:
            with tab("Networks"):
                add_side_by_side(parts, Path(about.network_file), Path(about.library_file).parent)
        with tab("Log"):
            self._log = EventLog(parts, self._past.look)
        if side is not None and about.learn and about.library_file:
            with side.add_tab("Learn", viser.Icon.SCHOOL):
                ask = self.panel.ask
                learning = LearnPanel(parts, about.learn, Path(about.library_file), dropped, ask)
                if rig is not None:
                    self.hands = HandRecorder(parts, rig, dropped, ask, self.panel.send, learning.look_at)
        if side is not None:
            side.dock_left()
            side.set_width(SIDE_WIDTH)
            side.expand()  # on a phone it stands below the rest, closed at first otherwise

    def show(self, latest: Picture, now: float) -> None:
        """Draws a picture at a time, s, and for browsers that look back what was shown then."""
        state = latest.snapshot
        commanded = state.queue, state.commanded_tempo, state.lock and state.lock.source
        if commanded != self._commanded:  # of these no event tells
            self._past.call_back()
        self._commanded = commanded
        self._past.timeline.keep(latest, shown_motions(state), now)
        self._history.keep(latest, now)
        if clients := self._page.get_clients():  # drawing without a browser costs as much
            self._draw(latest, min(now - self._last_picture, LONGEST_STEP))
            self._past.show(clients, self.panel.view(), self._centre, now)
        self._last_picture = now
        if not self._page.is_watched or now - self._last_health < 1.0 / HEALTH_PER_SECOND:
            return
        self._last_health, servos = now, latest.servos
        self.panel.show(latest.snapshot)
        self._past.timeline.show()
        if self.hands is not None and servos is not None:
            self.hands.show(servos)
        if self._rig is not None and self._glow is not None and servos is not None:
            self._glow.mark(self._rig.show(servos, now), self._scene.data, self._centre)

    def _draw(self, latest: Picture, dt: float) -> None:
        """Draws a picture, dt seconds after the last."""
        view, bodies = self.panel.view(), latest.arrays
        if view.follows:
            self._centre = self._camera.follow(bodies.qpos[:2], dt)
        centre = self._centre
        with self._page.atomic():  # one message for all of it
            self._bodies.show(bodies, view, centre)
            if self._network is not None:
                state = latest.snapshot
                self._network.show(bodies.activation, state.playing, state.phase, visible=view.network)
            self._steps.show(self._scene.data, centre, dt, visible=view.steps)
            if self._forces is not None and bodies.contacts is not None:
                self._forces.show(bodies.contacts, centre, visible=view.forces)
            if self._glow is not None:
                self._glow.show(self._scene.data, centre)

    def show_event(self, event: Event) -> None:
        """Shows an event of the deck."""
        if LOOKS.get(event.kind, ROUTINE).calls_back:
            self._past.call_back()
        self.panel.show_event(event)
        self._past.timeline.mark(event)
        self._log.note(event, self._history.now, self._history.now_s)

    def end(self, reason: str) -> None:
        """Shows that the run has ended, and why."""
        self._past.call_back()
        self._past.show(self._page.get_clients(), self.panel.view(), self._centre, 0.0)
        self.panel.end(reason)


def _model(file: str) -> mujoco.MjModel:
    try:
        return with_visuals(mujoco.MjSpec.from_file(file))[1]
    except ValueError as error:
        raise FileFormatError(f"{file}: MuJoCo refuses it: {error}") from error
