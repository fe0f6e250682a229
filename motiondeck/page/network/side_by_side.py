"""Courses of networks, of the one that plays and of others in its folder, for browsers that draw two side by side."""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import viser

from controller.library.motion_library import MotionLibrary, load_library
from motiondeck.page.web.parts import OwnPart, PageParts
from motiondeck_base.errors import MotiondeckError

POINTS = 100  # of a round of a loop, or of a whole one-shot
NEURONS = 100  # of most variance are sent


@lru_cache(4)
def _loaded(file: Path, written_ns: int) -> MotionLibrary:  # loaded anew once it has been written anew
    return load_library(file)


def course(library: MotionLibrary, motion: str) -> dict[str, Any]:
    """Plays a motion, or the first, once from its beginning: outputs and states, a list over POINTS phases for each."""
    frames = {one.name: one.frames for one in library.info.motions}
    motion = motion if motion in frames else next(iter(frames))
    network, out = library.network.twin(), np.zeros(library.network.channels)
    network.cue(motion, 0)
    kept = np.linspace(0, frames[motion] - 1, POINTS).round().astype(int).tolist()
    outputs, states = [], []
    for frame in range(frames[motion]):
        network.advance(out)
        for _ in range(kept.count(frame)):  # a short one has fewer frames than points
            outputs.append(out.round(3).tolist())
            states.append(network.activation.round(3).tolist() if network.activation is not None else [])
    most = np.argsort(-np.var(states, axis=0))[:NEURONS].tolist()
    neurons = {f"{place + 1}": [state[place] for state in states] for place in most}
    about = {"motion": motion, "motions": [*frames], "encoding": library.info.encoding}
    return about | {"outputs": np.transpose(outputs).tolist(), "neurons": neurons}


def add_side_by_side(parts: PageParts, network: Path, folder: Path) -> None:
    """Adds the part where the page's widgets are being added, for the file of the network that plays."""

    def answer(said: Any, event: viser.GuiEvent) -> None:
        match said:
            case [str(side), str(library), str(motion)] if event.client and side in sides and library in files:
                try:
                    found = course(_loaded(files[library], files[library].stat().st_mtime_ns), motion)
                except (MotiondeckError, OSError) as error:  # the file has been replaced by something else
                    found = {"reason": str(error)}
                sides[side].show(event.client, found)

    files = {"": network} | {file.stem: file for file in sorted(folder.glob("*.safetensors"))}
    parts.add("side-by-side", "side-by-side", {"libraries": [*files]}, answer).show({})
    sides = {side: OwnPart(parts, f"course-{side}") for side in ("left", "right")}
