"""What a figure costs on a microcontroller: formulas fitted to what `benchmarks export_board` counts with -Os."""

from typing import Any

from motiondeck.export.board_network import BoardNetwork
from motiondeck.export.figure import Figure
from motiondeck_base.errors import MotiondeckError, UnknownNameError

# Bytes of code; instructions of the worst tick: of any figure, more with each joint, with each joint of a layer, and
# with each satellite of the largest network, of 20 joints.
CORES = {
    "M4F": (16_150, 8_000, 1_200, 120, 1_600),
    "M3": (19_950, 184_000, 18_500, 1_100, 10_000),
    "M0+": (22_550, 382_000, 41_800, 2_200, 26_000),
}
FIXED = {  # without floating point, and networks
    "M4F": (15_700, 45_000, 6_100, 250, 0),
    "M3": (15_700, 45_000, 6_100, 250, 0),
    "M0+": (16_400, 80_000, 15_000, 450, 0),
}
_NETWORKS = 900  # bytes of code
_PLAYER, _PLAYER_JOINT, _STACK, _STACK_JOINT = 1056, 372, 720, 16  # bytes, with room for four layers and a blend


def cost_on(figure: Figure, board: str) -> dict[str, int]:
    """Flash and RAM, bytes, instructions of the worst tick, and more of them with a layer of all joints.

    The board is CORE:MHZ:RAM:FLASH, kB, of which the end may be left out. MotiondeckError if the figure does not fit.
    """
    (name, *given), joints = board.split(":"), len(figure.rest)
    [core] = UnknownNameError.indices("core", [name], [*CORES])
    code, base, joint, layer, satellite = [*(FIXED if figure.fixed else CORES).values()][core]
    ram, worst = _PLAYER + _STACK + (_PLAYER_JOINT + _STACK_JOINT) * joints, base + joint * joints
    held: Any = figure.library.network
    if networks := [len(one.form) for one in held.keys.values() if isinstance(one, BoardNetwork)]:
        code, worst = code + _NETWORKS, max(worst, base // 2 + satellite * max(networks))
    flash, has = code + len(figure.words), [float(one) if one.isdecimal() else 0.0 for one in given]
    uses = (1e-6 * worst * figure.rate, "MHz"), (1e-3 * ram, "kB of RAM"), (1e-3 * flash, "kB of flash")
    if short := [f"{use:.3g} {unit} of {most:g}" for (use, unit), most in zip(uses, has, strict=False) if use > most]:
        raise MotiondeckError(f"{board}: at worst it takes {', '.join(short)}; take fewer motions or another board")
    return {"flash": flash, "ram": ram, "instructions": worst, "layer": layer * joints}
