"""How far what is played is from the recordings that its library was learned from, where they lie beside it."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from controller.library.motion_library import load_library
from controller.motion.clip import AS_FOUND, Clip
from controller.motion.rotations import Array, Indices
from controller.motion.skeleton import Skeleton, SkeletonInfo
from motiondeck.page.plots import History
from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from controller.learning.measures.recording_errors import RecordedPart

NAMES = ("recording mean of joints", "recording farthest joint")


class AgainstRecordings:
    """Adds these two distances to a history, mm, for the human that a library's file plays."""

    def __init__(self, history: History, library: Path, human: SkeletonInfo) -> None:
        self._history, self._library, self._skeleton = history, library, Skeleton.restore(human)
        self._recorded: dict[str, RecordedPart | None] = {}
        self._latest: tuple[Indices, Array] | None = None  # both distances are of the same pictures in one answer
        history.derived |= {name: lambda at, k=k: self._distances(at)[:, k] for k, name in enumerate(NAMES)}

    def _distances(self, at: Indices) -> Array:
        """Both, or NaN where the recording is not known, shape (T, 2), mm."""
        from controller.learning.measures.recording_errors import distances

        if (latest := self._latest) is not None and latest[0] is at:
            return latest[1]
        history, found = self._history, np.full((len(at), 2), np.nan)
        motions = np.array([history.motions[place] for place in at])
        for motion in {*motions.tolist()}:
            if motion not in self._recorded:
                self._recorded[motion] = None  # for those that ask while it is read
                self._read(motion)
            if (recorded := self._recorded[motion]) is not None:
                mine = motions == motion
                root, rotation = (history.block(kept, at[mine]) for kept in ("human_root", "human_rotation"))
                played = Clip(motion, self._skeleton, 1.0, root, rotation.reshape(len(root), -1, 4))
                off = distances(played, history.column("phase", at[mine]), recorded)
                found[mine] = np.stack([off.mean(axis=1), off.max(axis=1)], axis=1)
        self._latest = at, found
        return found

    def _read(self, motion: str) -> None:
        from controller.learning.measures.recording_errors import recorded_part
        from controller.learning.recipe import recipe_of
        from controller.learning.recording_analysis import find_skeleton
        from controller.learning.training_set import read_motion

        with suppress(MotiondeckError, StopIteration):  # a library or a recording that is another one by now
            library = load_library(self._library)
            info = next(one for one in library.info.motions if one.name == motion)
            plan = next(one for one in recipe_of(library.info.recipe, self._library).motions if one.name == motion)
            file = (self._library.parent / plan.file).absolute()
            if (known := info.against_recording) is not None and file.is_file():
                skeleton = find_skeleton(file, AS_FOUND)
                plan = msgspec.structs.replace(plan, file=str(file), skeleton=skeleton and str(skeleton.absolute()))
                body, loop = library.body(motion), info.plays == "loop"
                part = recorded_part(read_motion(Path(), plan), known.from_s, known.to_s, loop=loop, body=body)
                self._recorded[motion] = part
