"""The view in the browser: the robot as it moves, a button for each motion, and how the loop is doing.

Runs as a process of its own (`python -m sim.view.viewer`), reads the latest state from shared memory and sends
commands over a socket, so that nothing it does can hold up the loop.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import sys
import time
from pathlib import Path

# The page draws; this process needs no OpenGL, and starts sooner without.
os.environ.setdefault("MUJOCO_GL", "disable")

import mujoco
import numpy as np
import viser

from controller.wire.command_socket import CommandClient
from controller.wire.messages import Event, Subscribe
from controller.wire.run_folder import REASON_FILE
from controller.wire.telemetry import StateReader
from motiondeck_base.errors import FileFormatError, MotiondeckError
from sim.view.drawn_model import DrawnModel
from sim.view.ghost import Ghost
from sim.view.learning.learn_panel import LearnPanel
from sim.view.live_footprints import LiveSteps
from sim.view.network_view import NetworkView
from sim.view.panel import Panel
from sim.view.rig.joint_glow import JointGlow
from sim.view.rig.rig_panel import RigPanel
from sim.view.scene import Follower, Scene
from sim.view.timeline import Timeline
from sim.view.web.private_page import PrivatePage

PICTURES_PER_SECOND = 30.0
HEALTH_PER_SECOND = 4.0
BESIDE = 0.75  # of the robot's height: so far aside a follower, or the human, is drawn
LAST_WORD = 1.2  # s for a browser to get the reason of the end
SIDE_WIDTH = 330  # pixels
LONGEST_WAIT = 60.0  # s for a deck that is starting


def view(state: Path, command_port: int | None, port: int) -> None:
    """Shows a deck until it ends or the process that started this one is gone; waits for its state file to appear.

    Prints the address of the page on standard error as soon as that answers. Without a command port, the state file
    says it.

    Raises:
        MotiondeckError: if there is no such deck, or the port is taken.
    """
    parent = os.getppid()
    # The deck starts this process first and loads its robot meanwhile, so that the page is there sooner.
    latest_start = time.monotonic() + LONGEST_WAIT
    while not state.exists() and os.getppid() == parent and time.monotonic() < latest_start:
        time.sleep(0.01)
    reader = StateReader.open(state)
    description = reader.description
    motions = [str(motion) for motion in description["motions"]]
    phased = bool(description.get("has_phase"))
    joints = [str(joint) for joint in description.get("joints", ())]
    if command_port is None:
        command_port = int(description["command_port"])
    model = _model(str(description["model_file"]))
    page = PrivatePage(port, label=f"Motiondeck · {description['robot']}")
    print(f"page: {page.address}", file=sys.stderr, flush=True)
    scene = Scene(page, model)
    files = [str(file) for file in description.get("followers", ())]
    followers = [DrawnModel(page, _model(file), scene.height, f" {k}") for k, file in enumerate(files)]
    ghost = None
    if about := description.get("human"):
        human = _model(str(about["file"]))
        # Followers stand to the right of the robot, on the side that the panel does not cover.
        aside = (BESIDE if followers else -BESIDE) * scene.height
        ghost = Ghost(DrawnModel(page, human, scene.height, " human"), human, about, aside)
    inside = NetworkView(page, Path(str(description["library"])), scene.height) if "library" in description else None
    steps = LiveSteps(page, model, np.array(description.get("rest", model.qpos0)), scene.height)
    panel = Panel(
        page,
        motions,
        joints,
        CommandClient(command_port),
        has_human=ghost is not None,
        has_phase=phased,
        has_network=inside is not None,
        library=Path(file) if (file := description.get("library_file")) else None,
        recognizable=description.get("recognizable", ()),
    )
    rig = glow = None
    servos, learn = description.get("rig"), description.get("learn")
    side = page.gui.add_panel() if servos or learn else None
    if side is not None and servos:
        with side.add_tab("Rig", viser.Icon.ENGINE):
            rig = RigPanel(page, panel.parts, servos, panel.ask)
        glow = JointGlow(page, model, [servo["joint"] for servo in servos["servos"]], scene.height)
    if side is not None and learn:
        with side.add_tab("Learn", viser.Icon.SCHOOL):
            LearnPanel(page, panel.parts, learn, Path(description["library_file"]), state.parent / "dropped", panel.ask)
    timeline = Timeline(panel.parts)
    if side is not None:
        side.dock_left()
        side.set_width(SIDE_WIDTH)
    events = CommandClient(command_port)
    with contextlib.suppress(MotiondeckError):
        events.post(Subscribe())
    follower = Follower()
    centre = np.zeros(2)
    last_picture = last_health = 0.0
    last_tick = -1.0
    try:
        while not reader.ended and os.getppid() == parent:
            now = time.monotonic()
            latest = reader.read()
            if latest is not None and latest["tick"][0] != last_tick and np.isfinite(latest["qpos"]).all():
                last_tick = latest["tick"][0]
                timeline.keep(latest, motions[int(latest["playing"][0])] if "playing" in latest else "", now)
                seen = timeline.seen(latest)
                dt = min(now - last_picture, 0.1)
                if panel.follows:
                    centre = follower.follow(seen["qpos"][:2], dt)
                scene.show(seen["qpos"], centre)
                with page.atomic():
                    beside = np.array([0.0, -BESIDE * scene.height])
                    for k, other in enumerate(followers):
                        qpos = seen[f"qpos {k}"].copy()
                        qpos[:2] = seen["qpos"][:2] + (k + 1) * beside
                        other.show(qpos, centre)
                    if ghost is not None:
                        human_at = seen["qpos"][:2]
                        ghost.show(panel.human, seen["human_root"], seen["human_turn"], human_at, centre)
                    if inside is not None:
                        playing = motions[int(latest["playing"][0])]
                        inside.show(latest["activation"], playing, visible=panel.shows_network)
                    steps.show(scene.data, centre, dt, visible=panel.marks_steps)
                    if glow is not None:
                        glow.show(scene.data, centre)
                last_picture = now
                if now - last_health >= 1.0 / HEALTH_PER_SECOND:
                    panel.show(latest)
                    timeline.show()
                    if rig is not None and glow is not None:
                        glow.mark(rig.show(latest, now), scene.data, centre)
                    last_health = now
            tell_news(events, panel, timeline)
            time.sleep(max(0.0, now + 1.0 / PICTURES_PER_SECOND - time.monotonic()))
        panel.end(_reason(state))
        page.flush()
        time.sleep(LAST_WORD if page.get_clients() else 0.0)
    finally:
        page.stop()
        if os.getppid() != parent and state.parent.name.startswith("motiondeck-"):
            # A deck that was killed could not tidy up after itself.
            shutil.rmtree(state.parent, ignore_errors=True)


def tell_news(events: CommandClient, panel: Panel, timeline: Timeline) -> None:
    """Shows the events that have arrived; a deck that has ended has none."""
    with contextlib.suppress(MotiondeckError):
        while (reply := events.receive(0.0)) is not None:
            if isinstance(reply, Event):
                panel.tell(reply)
                timeline.tell(reply)


def _reason(state: Path) -> str:
    """Why the run has ended; empty where the deck could not say it any more."""
    try:
        return state.with_name(REASON_FILE).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""


def _model(file: str) -> mujoco.MjModel:
    try:
        return mujoco.MjModel.from_xml_path(file)
    except ValueError as error:
        raise FileFormatError(f"{file}: MuJoCo refuses it: {error}") from error


def main(arguments: list[str] | None = None) -> int:
    """The command line of the view's process; returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m sim.view.viewer", description="Shows a running deck in the browser."
    )
    parser.add_argument("--state", type=Path, required=True, help="the deck's shared state file")
    parser.add_argument("--command-port", type=int, help="where the deck takes commands")
    parser.add_argument("--port", type=int, required=True, help="where to serve the page, on loopback")
    options = parser.parse_args(arguments)
    try:
        # viser announces itself on standard output, which belongs to the deck that started this process.
        with Path(os.devnull).open("w") as nowhere, contextlib.redirect_stdout(nowhere):
            view(options.state, options.command_port, options.port)
    except MotiondeckError as error:
        print(f"motiondeck: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 0
    return 0


if __name__ == "__main__":
    sys.exit(main())
