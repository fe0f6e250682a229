"""Makes the pictures of these docs from what is shipped, each by a command of the program, so that none can be stale.

.venv/bin/python docs/pictures.py            # all
.venv/bin/python docs/pictures.py NAME...    # some; a wrong name lists them

The page's are those of page_pictures.py. Three need more than is shipped and are not made here: clips.png is a `clip
plot` of recordings, op3-walk and humanoid-cmu-walk are `robot calibrate --picture` of published models.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Collection
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageSequence

from controller.deck.deck import Deck
from controller.library.motion_library import MotionLibrary
from controller.motion.clip import Clip
from controller.motion.formats.writing import bvh_text
from controller.networks.orbits import orbits
from motiondeck.libraries import load_library
from motiondeck.pictures.figures import new_figure, save
from motiondeck.pictures.offscreen import OffScreen
from motiondeck.pictures.video import contact_sheet
from motiondeck_base.shipped import find_robot
from sim.physics.kinematic_playback import KinematicPlayback
from sim.physics.playback import PhysicsPlayback
from sim.physics.walking.preview import AHEAD
from sim.robots.robot import DT, load_robot

DOCS = Path(__file__).parent
PICTURES = DOCS / "pictures"
PAGE = [sys.executable, str(DOCS / "page_pictures.py"), str(PICTURES)]
TOLD_APART = {"walk": "#266ec8", "jog": "#e67700", "waltz": "#2b8a3e", "box1": "#c92a2a"}


SHIPPED = ("thesis15", "cmu86")
GALLERY = """# Gallery

<!-- made by pictures.py gallery -->

Every motion of the shipped libraries, as the network plays it. The mannequin has the human's own joints; servo20
follows with 20 servos, within their limits. A strip shows eight moments from left to right, of one round of a loop or
of a single act. There is no physics in it; [walking](walking.md) shows robots on their own feet.

`motiondeck play walk` plays one. `motiondeck play walk --library cmu86 --robot servo20` plays one of the second
library. `python docs/pictures.py` makes the pictures of these pages anew, `python docs/pictures.py gallery` this page.

## Inside the networks

The orbits of thesis15's neurons in two directions, and how its motions overlap ([the networks](networks.md)):

![orbits of the neurons, and the overlap of the motions](pictures/network-inside.png)

Loops that are computed from others, below these ([morphs](networks.md)):

![mixtures of loops below the loops](pictures/morphs.webp)

What a centralized network costs as it grows ([centralized networks](centralized-networks.md)):

![processor time over samples, outputs, centers, satellites and segments](pictures/centralized-growth.png)
"""


def motiondeck(*words: str | Path) -> None:
    """Runs a command of the program."""
    subprocess.run([sys.executable, "-P", "-m", "motiondeck", *map(str, words)], check=True)


def benchmark(*words: str | Path) -> None:
    """Runs a benchmark."""
    subprocess.run([sys.executable, "-m", "benchmarks", *map(str, words)], check=True, cwd=DOCS.parent)


MORPHS = {
    "0.5 walk + 0.5 waltz": "half",
    "walk & waltz & ~jog": "not-jog",
    "1.25 walk - 0.25 jog": "beyond",
    "0.5 slow-walk + 0.5 jog": "hurry",
    "0.5 box1 + 0.5 box3": "boxes",
}


def morphs() -> None:
    """Loops that are computed from those of the shipped library, below these."""
    library = load_library("thesis15")
    for expression, name in MORPHS.items():
        library = library.morph(expression, name)
    rows = ("walk", "waltz", "slow-walk", "jog", "box1", "box3", *MORPHS.values())
    draw_sheet(library.model, "mannequin", out := PICTURES / "morphs.webp", rows)
    sheet = Image.open(out).convert("RGB")
    sheet.resize((sheet.width * 3 // 5, sheet.height * 3 // 5)).save(out, quality=75)


def draw_sheet(loaded: MotionLibrary, robot: str, out: Path, rows_of: Collection[str] = ()) -> None:
    """One row a motion, as `moments_of` has them."""
    contact_sheet([row for row in moments_of(loaded, robot) if not rows_of or row[0] in rows_of], out)


def gallery() -> None:
    """Each motion of each shipped library on both robots, a strip a file, and the page that shows them."""
    page = GALLERY
    for name in SHIPPED:
        library = load_library(name).model
        rows = {robot: moments_of(library, robot) for robot in ("mannequin", "servo20")}
        page += f"\n## {name}\n"
        for place, motion in enumerate(library.info.motions):
            out = PICTURES / "gallery" / f"{name}-{motion.name}.webp"
            out.parent.mkdir(exist_ok=True)
            strips = [(robot, row[place][1], row[place][2]) for robot, row in rows.items()]
            contact_sheet(strips, out, (100, 112))
            Image.open(out).convert("RGB").save(out, quality=70, method=6)
            words = f"{motion.name} on both robots"
            page += f"\n**{motion.name}**, {motion.plays}\n\n![{words}](pictures/gallery/{out.name})\n"
    (DOCS / "gallery.md").write_text(page, encoding="utf-8")


def moments_of(loaded: MotionLibrary, robot: str) -> list[tuple[str, mujoco.MjModel, list[NDArray[np.float64]]]]:
    """Each motion at eight moments of one period of a loop, or of the moving part of a single act."""
    body = load_robot(find_robot(robot), loaded.skeleton)
    rows = []
    for motion in loaded.info.motions:
        # A third of what a single act was learned from is the pose that it holds in the end.
        seconds = motion.frames / loaded.info.rate * (1.0 if motion.plays == "loop" else 0.6)
        deck, stage, moments = Deck(loaded, body.retarget, motion.name), KinematicPlayback(body), []
        steps = round(seconds / DT / 8)
        for tick in range(1, 8 * steps + 1):
            targets, pose = deck.update(seconds / (8 * steps))
            if tick % steps == 0:
                stage.write(np.clip(targets, body.limits.lower, body.limits.upper), pose)
                moments.append(stage.qpos.copy())
        rows.append((motion.name, body.drawn, moments))
    return rows


def film() -> None:
    """Four motions with the switches between them: as they were learned, and by a robot on its own feet."""
    fps, seconds = 12, 12.0
    options = ["--script", "walk 3, jog 3, waltz 3, box1 3", "--size", "320x300", "--fps", str(fps)]
    halves: list[list[Image.Image]] = []
    with tempfile.TemporaryDirectory() as folder:
        for more in ([], ["--root", "free", "--walk", "--footprints"]):
            half = Path(folder) / f"{len(halves)}.gif"
            motiondeck("play", *options, "--seconds", str(seconds + AHEAD), *more, "--video", half)
            halves.append([frame.convert("RGB") for frame in ImageSequence.Iterator(Image.open(half))])
    learned, walked = halves
    # The body is so much later than the motion.
    both = list(zip(learned, walked[round(AHEAD * fps) :], strict=False))
    frames = [Image.new("RGB", (640, 300)) for _ in both]
    for frame, (left, right) in zip(frames, both, strict=True):
        frame.paste(left, (0, 0))
        frame.paste(right, (320, 0))
    # One palette for all, so that what does not move is stored once.
    palette = frames[0].quantize(96)
    small = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    small[0].save(DOCS / "motiondeck.gif", save_all=True, append_images=small[1:], duration=1000 / fps, loop=0)


def walk() -> None:
    """A walk on the robot's own feet."""
    with tempfile.TemporaryDirectory() as folder:
        film = Path(folder) / "walk.gif"
        options = ["--root", "free", "--walk", "--seconds", 8, "--footprints", "--size", "320x240", "--fps", 8]
        motiondeck("play", "walk", "--robot", "servo20", *map(str, options), "--video", film)
        frames = [frame.convert("RGB") for frame in ImageSequence.Iterator(Image.open(film))][::7]
    sheet = Image.new("RGB", (4 * 320, 2 * 240))
    for place, frame in enumerate(frames[:8]):
        sheet.paste(frame, (place % 4 * 320, place // 4 * 240))
    sheet.save(PICTURES / "walk-servo20.webp", quality=80)


def beside() -> None:
    """The human's walk, and the robots on their own feet at the same times of it."""
    library = load_library("thesis15").model
    first, apart, lag = round(6.0 / DT), round(0.2 / DT), round(AHEAD / DT)
    ticks = range(first, first + 8 * apart, apart)
    human = load_robot(find_robot("mannequin"), library.skeleton)
    deck, played = Deck(library, human.retarget, "walk"), np.zeros((ticks[-1] + 1, human.model.nq))
    for qpos in played:
        human.place(*deck.update(DT), qpos)
    rows = [("human", human.model, [played[tick] for tick in ticks])]
    for name in ("servo20", "mannequin"):
        robot = load_robot(find_robot(name), library.skeleton)
        deck, stage = Deck(library, robot.retarget, "walk"), PhysicsPlayback(robot, DT, "free", walk=True)
        walked = np.zeros((ticks[-1] + lag + 1, robot.model.nq))
        for qpos in walked:
            stage.write(*deck.update(DT))
            qpos[:] = stage.qpos
        rows.append((name, robot.model, [walked[tick + lag] for tick in ticks]))
    contact_sheet(rows, PICTURES / "walk-beside-human.webp", (170, 190))


def doors() -> None:
    """The three doors of the first page: the motion, a robot that plays it, and the dials of a rig."""
    library = load_library("thesis15").model
    for name, robot in (("motion", "mannequin"), ("robot", "servo20")):
        body = load_robot(find_robot(robot), library.skeleton)
        deck, stage = Deck(library, body.retarget, "waltz"), KinematicPlayback(body)
        with OffScreen(body.drawn, (480, 320), shadows=True) as screen:
            for _ in range(round(2.6 / DT)):
                stage.write(*deck.update(DT))
                screen.follow(stage.qpos)
            save_door(Image.fromarray(screen.draw(stage.qpos)), name)
    save_door(Image.open(PICTURES / "page-keys.webp").convert("RGB").crop((263, 180, 743, 500)), "rig")


def save_door(picture: Image.Image, name: str) -> None:
    """Saves one of the doors."""
    picture.save(PICTURES / f"door-{name}.webp", quality=80)


def rise() -> None:
    """A walking robot is pushed over backwards, and gets up."""
    library = load_library("thesis15").model
    robot = load_robot(find_robot("servo20"), library.skeleton)
    deck, stage = Deck(library, robot.retarget, "walk"), PhysicsPlayback(robot, DT, "free", walk=True)
    times, pictures = iter((2.0, 2.5, 3.0, 4.0, 5.8, 6.3, 7.2, 8.8, 10.2, 11.6, 13.2, 15.8)), []
    when = next(times)
    with OffScreen(robot.model, (240, 200)) as screen:
        for tick in range(round(16.0 / DT)):
            if tick == round(2.0 / DT):
                stage.push_from("front", 2.0)
            stage.write(*deck.update(DT))
            screen.follow(stage.qpos)
            if tick * DT >= when:
                pictures.append(Image.fromarray(screen.draw(stage.qpos)))
                when = next(times, np.inf)
    sheet = Image.new("RGB", (6 * 240, 2 * 200))
    for place, picture in enumerate(pictures):
        sheet.paste(picture, (place % 6 * 240, place // 6 * 200))
    sheet.save(PICTURES / "rise-servo20.webp", quality=80)


def clips() -> None:
    """A walk as `clip plot` draws it, and four motions in a row as `segment` cuts them."""
    library = load_library("thesis15").model
    deck, places, turns = Deck(library, lambda pose: np.zeros(0), "walk"), [], []
    for frame in range(16 * 60):
        if frame in (240, 480, 720):
            deck.switch({240: "jog", 480: "waltz", 720: "box1"}[frame])
        _, pose = deck.update(1.0 / 60.0)
        places.append(pose.root_position.copy())
        turns.append(pose.rotation.copy())
    with tempfile.TemporaryDirectory() as folder:
        for name, frames in (("walk", 230), ("session", None)):
            clip = Clip(name, library.skeleton, 60.0, np.array(places[:frames]), np.array(turns[:frames]))
            Path(folder, f"{name}.bvh").write_text(bvh_text(clip))
        drawn = Path(folder, "drawn.png")
        motiondeck("clip", "plot", Path(folder, "walk.bvh"), "--out", drawn)
        smaller(drawn, PICTURES / "clip-walk.webp")
        motiondeck("segment", Path(folder, "session.bvh"), "--plot", drawn)
        smaller(drawn, PICTURES / "segments.webp")


def smaller(picture: Path, out: Path) -> None:
    """Saves a picture with a width of 1000 pixels."""
    drawn = Image.open(picture).convert("RGB")
    drawn.resize((1000, round(1000 * drawn.height / drawn.width))).save(out, quality=80)


def network() -> None:
    """The orbits of the shipped network's neurons, and how its motions overlap."""
    library = load_library("thesis15").model
    assert library.network.activation is not None
    found = orbits(library.network, {motion.name: motion.frames for motion in library.info.motions})
    figure = new_figure(11.0, 5.0)
    paths, overlap = figure.subplots(1, 2)
    for name, path in found.paths.items():
        colour = TOLD_APART.get(name)
        paths.plot(
            path[:, 0],
            path[:, 1],
            color=colour or "#ced4da",
            linewidth=1.8 if colour else 0.6,
            label=name if colour else None,
        )
    paths.set(aspect="equal", xlabel="first principal component", ylabel="second")
    paths.set_title(f"orbits of the neurons ({100.0 * found.share:.0f} % of the variance in three)")
    paths.legend(loc="upper right")
    image = overlap.imshow(found.overlap, cmap="Blues", vmin=0.0, vmax=1.0)
    names = list(found.paths)
    overlap.set_xticks(np.arange(len(names)), names, rotation=90)
    overlap.set_yticks(np.arange(len(names)), names)
    overlap.set_title("overlap of the motions")
    figure.colorbar(image, ax=overlap)
    save(figure, PICTURES / "network-inside.png")


MADE: dict[str, Callable[[], object]] = {
    "page": lambda: subprocess.run(PAGE, check=True),
    "motiondeck.gif": film,
    "walk-servo20": walk,
    "walk-beside-human": beside,
    "rise-servo20": rise,
    "doors": doors,
    "clips": clips,
    "network-inside": network,
    "morphs": morphs,
    "gallery": gallery,
    "balance": lambda: benchmark("balance", "--sheet", DOCS / "balance.png"),
    "centralized-growth": lambda: benchmark("centralized_growth", "--plot", PICTURES / "centralized-growth.png"),
}

if __name__ == "__main__":
    unknown = set(sys.argv[1:]) - set(MADE)
    if unknown:
        sys.exit(f"{', '.join(sorted(unknown))}: choose from {', '.join(MADE)}")
    for name in sys.argv[1:] or MADE:
        print(name, flush=True)
        MADE[name]()
