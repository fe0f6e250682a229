"""Strangers lead a robot by head and hands, or six points: walk, stop, hurry.

People who were not learned walk (CMU), stop, go back, hurry and are gone. Each recording is carried to the library's
body and goes on by its last stride where it ends. It is measured as `motiondeck stage` measures trackers: 30 times a
second, with 20 mm of noise, a fifth of the points lost, 100 ms of silence in each second. The deck plays thesis15 for
the robot and is locked to the person. Of each stretch: how far the joints of the deck's body are from the person's,
relative to the hips and their heading, mm (mean), beside the same deck by the clock, and the deck's tempo at the end;
and the largest second difference of the targets behind the safety envelope, beside the same deck by the clock.
`--film` draws the first person and the robot.

    python -m benchmarks led_robot --data DIR [--points six] [--film FILE.gif] [--frames DIR]
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from PIL import Image, ImageDraw

from benchmarks import command
from benchmarks.reservoirs.body_drives import in_frame
from controller.deck.deck import Deck
from controller.deck.person_follower import PersonFollower
from controller.learning.reservoirs.completion_training import learn_completion
from controller.library.motion_library import MotionLibrary, load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.canonical.canonical_body import carried
from controller.motion.canonical.clip_edits import resampled
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import Array
from controller.motion.skeleton import Skeleton
from motiondeck.pictures.offscreen import OffScreen
from motiondeck_base.shipped import find_library, find_robot
from sim.robots.robot import Robot, load_robot

DT, EVERY, SIZE = 1.0 / 120.0, 4, 480
WALKS = ("07_01", "08_01", "35_01", "02_01")
POINTS = {"three": ("head", "lhan", "rhan"), "six": ("head", "lhan", "rhan", "root", "lank", "rank")}
STRETCHES = (
    ("walks", 1.5, 1.0),
    ("stops", 1.2, 0.0),
    ("goes back", 0.5, -1.0),
    ("hurries", 0.7, 1.7),
    ("is gone", 2.5, None),
)


def going_on(walk: Array, ticks: int) -> Array:
    """A walk (T, J, 3) at 1 / DT that goes on by the stride, of 0.75 to 1.3 s, whose ends are most alike."""
    shape = own_frame(walk)
    shape = np.concatenate([shape, 0.1 / DT * np.gradient(shape, axis=0)], axis=1)
    ends = [(a, b) for b in range(len(walk) - 36, len(walk) - 12) for a in range(max(10, b - 156), b - 90)]
    a, b = min(ends, key=lambda two: float(np.linalg.norm(shape[two[0]] - shape[two[1]])))
    parts, stride = [walk[:b]], walk[a:b] - walk[a, 0] * [1.0, 1.0, 0.0]
    eased = np.exp(-np.arange(b - a) / 12.0)[:, None, None]
    for _ in range(-(-ticks // (b - a))):
        last = 2.0 * parts[-1][-1] - parts[-1][-2]
        turn = sideways(last) - sideways(stride[0])
        turned = stride @ np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        turned += last[0] * [1.0, 1.0, 0.0]
        parts.append(turned + eased * (last - turned[0]))
    return np.concatenate(parts)


def sideways(joints: Array) -> Array:
    """The angle of the line from hip to hip of joints (..., J, 3), rad."""
    side = joints[..., 5, :2] - joints[..., 1, :2]
    return np.arctan2(side[..., 1], side[..., 0])


def own_frame(joints: Array) -> Array:
    """Joints (T, J, 3) relative to the hips and their heading, (T, 3 J)."""
    return in_frame(joints, joints[:, 0], -sideways(joints))


class Run:
    """What a person and the deck did, tick by tick."""

    def __init__(self, library: MotionLibrary, robot: Robot, walk: Path, points: Sequence[str], *, led: bool) -> None:
        skeleton, rng = library.encoding.skeleton, np.random.default_rng(51)
        clip = carried(resampled(read_clip(walk), 1.0 / DT), skeleton)
        person, own = going_on(clip.joints(), 400), [("root", *skeleton.bones).index(point) for point in points]
        deck = Deck(library, robot.retarget, "walk")
        follower = PersonFollower(library, points, learn=learn_completion)
        if led:
            deck.lock("person")
        envelope = SafetyEnvelope(robot.limits, DT)
        envelope.start(np.clip(deck.update(DT)[0], robot.limits.lower, robot.limits.upper))
        self.person: list[Array] = []
        self.body: list[Array] = []
        self.targets: list[Array] = []
        self.qpos: list[Array] = []
        self.tempo: list[float] = []
        self.stretch: list[str] = []
        at, tick, qpos = 0.15 * len(clip), 0, np.zeros(robot.model.nq)
        for name, seconds, tempo in STRETCHES:
            for _ in range(round(seconds / DT)):
                now = person[min(max(round(at), 0), len(person) - 1)]
                at += tempo or 0.0
                if led and tempo is not None and tick % EVERY == 0:
                    silent = tick * DT % 1.0 > 0.9
                    seen = {
                        point: tuple(now[joint] + 0.02 * rng.standard_normal(3))
                        for point, joint in zip(points, own, strict=True)
                        if not silent and rng.random() >= 0.2
                    }
                    if (place := follower.step(seen)) is not None and seen:
                        deck.follow(*place, body=follower.body)
                targets, pose = deck.update(DT)
                safe = envelope(targets)
                robot.place(safe, pose, qpos)
                self.person.append(now)
                self.body.append(skeleton.joints(pose.root_position, pose.rotation))
                self.targets.append(safe.copy())
                self.qpos.append(qpos.copy())
                self.tempo.append(deck.tempo)
                self.stretch.append(name)
                tick += 1

    def apart(self) -> Array:
        """The distance of the deck's joints from the person's in each tick, mm."""
        off = own_frame(np.array(self.person)) - own_frame(np.array(self.body))
        return 1e3 * np.linalg.norm(off.reshape(len(off), -1, 3), axis=-1).mean(1)

    def change(self) -> float:
        """The largest second difference of the targets, rad/s^2."""
        return float(np.abs(np.diff(np.array(self.targets), 2, axis=0)).max()) / DT**2


def film(robot: Robot, run: Run, skeleton: Skeleton, points: Sequence[str], fps: float) -> list[Image.Image]:
    """The person as lines, with the three points, and the robot."""
    pictures: list[Image.Image] = []
    ahead = run.person[-1][0, :2] - run.person[0][0, :2]
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    with OffScreen(robot.model, (SIZE, SIZE), camera="side") as screen:
        for tick in range(0, len(run.person), round(1.0 / (fps * DT))):
            picture = Image.new("RGB", (2 * SIZE, SIZE), "white")
            pen, joints = ImageDraw.Draw(picture), run.person[tick]
            middle = joints[0]
            flat = [(SIZE / 2 + 220 * float((one - middle)[:2] @ ahead), 430 - 220 * one[2]) for one in joints]
            for bone, parent in enumerate(skeleton.parent.tolist()):
                pen.line([flat[1 + parent], flat[1 + bone]], fill="black", width=4)
            gone = run.stretch[tick] == "is gone"
            for point in points:
                x, y = flat[1 + skeleton.bones.index(point)]
                pen.ellipse([x - 8, y - 8, x + 8, y + 8], fill="gray" if gone else "red")
            picture.paste(Image.fromarray(screen.draw(run.qpos[tick], cut=True)), (SIZE, 0))
            text = f"{tick * DT:4.1f} s: the person {run.stretch[tick]}"
            pen.text((12, 10), text, fill="black", font_size=20)
            pen.text((SIZE + 12, 10), f"tempo {run.tempo[tick]:.2f}", fill="black", font_size=20)
            pictures.append(picture)
    return pictures


def main(
    data: Annotated[Path, typer.Option(help="The folder with the recordings.")],
    points: Annotated[str, typer.Option(help="three (head, hands) or six (also hips, feet).")] = "three",
    film_file: Annotated[Path | None, typer.Option("--film", help="Draw the first, as .gif or .webp.")] = None,
    frames: Annotated[Path | None, typer.Option(help="Write every fifth picture as a PNG here as well.")] = None,
) -> None:
    library = load_library(find_library("thesis15"))
    names = [name for name, _, _ in STRETCHES]
    print(f"| person | {' | '.join(f'{name}: mm, by the clock, tempo' for name in names)} | rad/s^2, alone |")
    print("|---" * (len(names) + 2) + "|")
    for walk in WALKS:
        path = data / "cmu" / walk[:2] / f"{walk}.amc"
        robot = load_robot(find_robot("servo20"), library.skeleton, dt=DT)
        led, free = (Run(library, robot, path, POINTS[points], led=led) for led in (True, False))
        stretch, cells = np.array(led.stretch), []
        for name in names:
            own = stretch == name
            mm = "" if name == "is gone" else f"{led.apart()[own].mean():.0f}, {free.apart()[own].mean():.0f}, "
            cells.append(f"{mm}{np.array(led.tempo)[own][-1]:.2f}")
        print(f"| {walk} | {' | '.join(cells)} | {led.change():.0f}, {free.change():.0f} |", flush=True)
        if film_file is not None and walk == WALKS[0]:
            pictures = film(robot, led, library.encoding.skeleton, POINTS[points], 10.0)
            pictures[0].save(film_file, save_all=True, append_images=pictures[1:], duration=100, loop=0)
            if frames is not None:
                frames.mkdir(parents=True, exist_ok=True)
                for number in range(0, len(pictures), 5):
                    pictures[number].save(frames / f"{number:03}.png")


if __name__ == "__main__":
    command.run("led_robot", main, __doc__)
