"""A robot beside the human whose motion it plays: in a picture, and in the browser."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from controller.cli.resources import find
from controller.errors import UnknownNameError
from controller.mocap.posture import Pose
from controller.realtime.deck import Deck
from controller.rotations import Array
from controller.training.library import load_library
from sim.side_by_side import SideBySide

PICTURES_A_SECOND = 30.0
SECONDS = 2.0
MOMENTS = 8


def draw_beside(library: str, motion: str, robot: Path, out: Path) -> None:
    """One row: moments of a motion, the human on the left and the robot on the right."""
    from sim.video import contact_sheet

    both, poses = _open(library, motion, robot)
    every = max(1, round(SECONDS * PICTURES_A_SECOND / MOMENTS))
    row: list[Array] = []
    for frame, pose in enumerate(poses):
        qpos = both.qpos(pose)
        if frame % every == every - 1:
            row.append(qpos.copy())
        if len(row) == MOMENTS:
            break
    contact_sheet(both.model, [(motion, row)], out)


def view_beside(library: str, motion: str, robot: Path, port: int) -> None:
    """Shows both in the browser until Ctrl-C."""
    from sim.private_page import PrivatePage
    from sim.scene import Follower, Scene

    both, poses = _open(library, motion, robot)
    # viser announces itself on standard output, which is for what the command says.
    with Path(os.devnull).open("w") as nowhere, contextlib.redirect_stdout(nowhere):
        page = PrivatePage(port, label=f"Motiondeck · {robot.stem}")
    scene, follower = Scene(page, both.model), Follower()
    print(f"page: http://127.0.0.1:{port} (Ctrl-C ends it)", file=sys.stderr, flush=True)
    try:
        for pose in poses:
            start = time.monotonic()
            qpos = both.qpos(pose)
            scene.show(qpos, follower.follow(qpos[:2].copy(), 1.0 / PICTURES_A_SECOND))
            time.sleep(max(0.0, start + 1.0 / PICTURES_A_SECOND - time.monotonic()))
    except KeyboardInterrupt:
        pass
    finally:
        page.stop()


def _open(library: str, motion: str, robot: Path) -> tuple[SideBySide, Iterator[Pose]]:
    loaded = load_library(find("library", library, ".safetensors"))
    if motion not in loaded.network.motions:
        raise UnknownNameError.among("motion", motion, loaded.network.motions)
    human = find("robot", "mannequin", ".toml")
    both = SideBySide(loaded.skeleton, human, robot, 1.0 / PICTURES_A_SECOND)
    return both, _poses(Deck(loaded, _no_joints, motion))


def _no_joints(pose: Pose) -> Array:
    """For a deck that is asked for its poses only."""
    return np.zeros(0)


def _poses(deck: Deck) -> Iterator[Pose]:
    while True:
        _, pose = deck.update(1.0 / PICTURES_A_SECOND)
        yield Pose(pose.root_position.copy(), np.asarray(pose.heading), pose.rotation.copy())
