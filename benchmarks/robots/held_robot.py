"""A robot is held by its knees and let go: locked to its body, or not.

Physics with the servos' own torques. Each hand is a spring and damper of limited force between a knee (where the shank
begins) and where it was when the hold began. Both robots get targets through the same safety envelope; the clip player
reads one recorded round by the clock. Says how far the targets of each are from its joints, what the hands have to
hold, and how fast joints move and targets change afterwards; `--film` draws both side by side.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from controller.deck.deck import Deck
from controller.library.motion_library import load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from motiondeck.pictures.offscreen import OffScreen
from motiondeck_base.shipped import find_library, find_robot
from sim.physics.playback import PhysicsPlayback
from sim.robots.robot import Robot, load_robot

DT = 1.0 / 200.0
STIFFNESS, DAMPING, STRENGTH = 4000.0, 15.0, 60.0  # of a hand: N/m, N s/m, N
HELD_BODIES = ("l_shank", "r_shank")
SIZE = 480

Player = Callable[[], tuple[Array, Pose]]


@dataclass
class Held:
    """What happened to one robot, tick by tick: positions (T, nq), targets and joints (T, J), force (T,), N."""

    qpos: Array
    targets: Array
    joints: Array
    force: Array
    tempo: Array


def clip_player(robot: Robot, seconds: float, deck: Deck) -> Player:
    """Plays one recorded round of joint targets by the clock, again and again, and nothing else."""
    for _ in range(round(seconds / DT)):
        deck.update(DT)
    recorded = [(targets.copy(), pose) for targets, pose in (deck.update(DT) for _ in range(round(seconds / DT)))]
    tick = -1

    def play() -> tuple[Array, Pose]:
        nonlocal tick
        tick += 1
        return recorded[tick % len(recorded)]

    return play


def run(robot: Robot, play: Player, stage: PhysicsPlayback, tempo: Callable[[], float], times: Array) -> Held:
    """Plays on a stage while hands hold it from times[0] to times[1], until times[2], s."""
    bodies = [mujoco.mj_name2id(stage.model, mujoco.mjtObj.mjOBJ_BODY, name) for name in HELD_BODIES]
    limits, anchors = robot.limits, None
    envelope = SafetyEnvelope(limits, DT)
    envelope.start(np.clip(play()[0], limits.lower, limits.upper))
    rows: list[tuple[Array, Array, Array, float, float]] = []
    velocity = np.zeros(6)
    for tick in range(round(times[2] / DT)):
        stage.data.xfrc_applied[bodies, :3] = 0.0
        if times[0] <= tick * DT < times[1]:
            anchors = stage.data.xpos[bodies].copy() if anchors is None else anchors
            for body, anchor in zip(bodies, anchors, strict=True):
                mujoco.mj_objectVelocity(stage.model, stage.data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
                force = STIFFNESS * (anchor - stage.data.xpos[body]) - DAMPING * velocity[3:]
                force *= min(1.0, STRENGTH / max(float(np.linalg.norm(force)), 1e-9))
                stage.data.xfrc_applied[body, :3] = force
        hands = float(np.linalg.norm(stage.data.xfrc_applied[bodies, :3], axis=1).max())
        targets, pose = play()
        safe = envelope(targets)
        stage.write(safe, pose)
        rows.append((stage.qpos.copy(), safe.copy(), stage.measured().copy(), hands, tempo()))
    return Held(*(np.array(column) for column in zip(*rows, strict=True)))


def report(name: str, held: Held, times: Array) -> str:
    begin, end = round(times[0] / DT), round(times[1] / DT)
    away = np.abs(held.targets - held.joints)
    speed = np.abs(np.diff(held.joints, axis=0)).max(1) / DT
    change = np.abs(np.diff(held.targets, 2, axis=0)).max(1) / DT**2
    cells = [
        f"{away[end - 100 : end].max():.2f}",
        f"{np.ptp(held.targets[end - 200 : end], axis=0).max():.3f}",
        f"{held.force[begin:end].max():.0f}",
        f"{speed[:begin].max():.1f}",
        f"{speed[end : end + 200].max():.1f}",
        f"{np.abs(held.joints[end + 20] - held.joints[end - 1]).max():.2f}",
        f"{change[200:begin].max():.0f}",
        f"{change[end : end + 200].max():.0f}",
    ]
    return f"| {name} | {' | '.join(cells)} |"


def film(robot: Robot, both: dict[str, Held], times: Array, fps: float) -> Iterator[Image.Image]:
    """Both robots side by side, with red balls where hands hold them."""
    spec = robot.spec.copy()
    for name in HELD_BODIES:
        ball = spec.body(name).add_geom()
        ball.type, ball.size, ball.rgba = mujoco.mjtGeom.mjGEOM_SPHERE, [0.035, 0.0, 0.0], [0.9, 0.1, 0.1, 0.0]
        ball.contype = ball.conaffinity = 0
        ball.name = f"hand on {name}"
    model = spec.compile()
    balls = [model.geom(f"hand on {name}").id for name in HELD_BODIES]
    with OffScreen(model, (SIZE, SIZE), camera="side") as screen:
        for tick in range(0, len(next(iter(both.values())).qpos), round(1.0 / (fps * DT))):
            holds = times[0] <= tick * DT < times[1]
            model.geom_rgba[balls, 3] = 1.0 if holds else 0.0
            picture = Image.new("RGB", (2 * SIZE, SIZE))
            pen = ImageDraw.Draw(picture)
            for place, (name, held) in enumerate(both.items()):
                picture.paste(Image.fromarray(screen.draw(held.qpos[tick], cut=True)), (place * SIZE, 0))
                what = f"tempo {held.tempo[tick]:.2f}" + (", held" if holds else "")
                pen.text((place * SIZE + 12, 10), f"{name}\n{tick * DT:4.1f} s, {what}", fill="black", font_size=20)
            yield picture


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks held_robot", description=__doc__)
    parser.add_argument("--motion", default="walk")
    parser.add_argument("--robot", default="servo20")
    parser.add_argument("--times", type=float, nargs=3, default=[3.3, 6.3, 9.5], metavar="S", help="hold, let go, end")
    parser.add_argument("--film", type=Path, metavar="FILE.gif", help="draw it, as .gif or .webp")
    parser.add_argument("--frames", type=Path, metavar="DIR", help="write each fifth picture as a PNG as well")
    options = parser.parse_args()
    library = load_library(find_library("thesis15"))
    times = np.array(options.times)

    def load() -> tuple[Robot, Deck, PhysicsPlayback]:
        robot = load_robot(find_robot(options.robot), library.skeleton, dt=DT)
        return robot, Deck(library, robot.retarget, options.motion), PhysicsPlayback(robot, DT, "fixed")

    robot, deck, stage = load()
    deck.measured = stage.measured
    deck.lock("body")
    locked = run(robot, lambda: deck.update(DT), stage, lambda: deck.tempo, times)
    robot, deck, stage = load()
    info = next(info for info in library.info.motions if info.name == options.motion)
    player = clip_player(robot, info.frames / library.info.rate, deck)
    clip = run(robot, player, stage, lambda: 1.0, times)
    both = {"locked to its body": locked, "clip player": clip}
    heads = ("", "targets off the held joints, rad", "targets move in the last second held, rad", "hands hold, N")
    heads += (
        "joints before, rad/s",
        "let go, rad/s",
        "joints go in 0.1 s, rad",
        "targets before, rad/s^2",
        "let go, rad/s^2",
    )
    print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    for name, held in both.items():
        print(report(name, held, times))
    if options.film is not None:
        fps = 10.0
        pictures = list(film(robot, both, times, fps))
        pictures[0].save(options.film, save_all=True, append_images=pictures[1:], duration=round(1e3 / fps), loop=0)
        if options.frames is not None:
            options.frames.mkdir(parents=True, exist_ok=True)
            for number in range(0, len(pictures), 5):
                pictures[number].save(options.frames / f"{number:03}.png")


if __name__ == "__main__":
    sys.exit(main())
