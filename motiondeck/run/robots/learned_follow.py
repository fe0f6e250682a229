"""The learned correction of a rig: opened with the run, kept in the user's own folder, forgotten when the rig changes.

    XDG_STATE_HOME (else ~/.local/state)/motiondeck/follow/LIBRARY-NUMBER.safetensors

NUMBER is that of the rig's joints. A table (knots, J) float32, rad, per motion and class of tempo; the metadata has the
digest of all that they were learned with: rig file, robot, library, and whether the servos were emulated.
"""

import hashlib
import json
import sys
import zlib
from contextlib import ExitStack
from pathlib import Path

import msgspec
import numpy as np

from controller.deck.deck import Deck
from controller.deck.interfaces import JointLimits
from controller.library.motion_library import LibraryInfo
from controller.loop.correction import Correction, Key
from controller.loop.lead import Lead
from controller.motion.rotations import Array
from motiondeck.run.robots.rig_output import RigOutput
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import write_file
from motiondeck_base.shipped import state_folder

_DIGEST = "learned with"


def open_correction(
    opening: ExitStack,
    rig: RigOutput,
    deck: Deck,
    lead: Lead,
    limits: JointLimits,
    period: float,
    *,
    robot: str,
    library: LibraryInfo,
    emulated: bool,
) -> Correction | None:
    """The correction of a rig whose file asks for one, as it was learned so far; `opening` keeps what it learns."""
    config = rig.rig.config
    if not config.follow.learn:
        return None
    number = zlib.crc32(" ".join(config.names).encode())
    file = state_folder() / "follow" / f"{library.name}-{number:08x}.safetensors"
    parts = [msgspec.to_builtins(config), robot, msgspec.to_builtins(library), emulated]
    digest = hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()
    shape = len(limits.lower)
    tables = {key: table for key, table in load(file, digest).items() if table.shape[1] == shape}
    correction = Correction(lambda: deck.place, lead.delays, lead.seconds, limits, period, tables)
    rig.correction = correction
    opening.callback(save, file, digest, tables)
    return correction


def load(file: Path, digest: str) -> dict[Key, Array]:
    """The tables of a file; none if there is no such file, or they were learned with anything else."""
    from safetensors import SafetensorError, safe_open

    tables: dict[Key, Array] = {}
    try:
        with safe_open(file, "np") as kept:
            if (kept.metadata() or {}).get(_DIGEST) != digest:
                return {}
            for name in kept.keys():  # noqa: SIM118 (it is no dictionary)
                tempo, _, motion = name.partition(" ")
                table = np.asarray(kept.get_tensor(name), dtype=np.float64)
                if table.ndim == 2 and len(table) >= 8 and np.isfinite(table).all():
                    tables[motion, int(tempo)] = table
    except (OSError, SafetensorError, ValueError):
        return {}
    return tables


def save(file: Path, digest: str, tables: dict[Key, Array]) -> None:
    """Keeps the tables in which anything was learned; prints a line if the file cannot be written."""
    from safetensors.numpy import save

    learned = {f"{tempo} {motion}": own.astype(np.float32) for (motion, tempo), own in tables.items() if own.any()}
    try:
        if learned:
            file.parent.mkdir(parents=True, exist_ok=True)
            write_file(file, save(learned, {_DIGEST: digest}))
    except (OSError, MotiondeckError) as error:
        print(f"motiondeck: what the rig has learned is not kept: {error}", file=sys.stderr)
