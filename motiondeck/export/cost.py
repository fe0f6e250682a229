"""What a figure costs on a microcontroller: formulas fitted to what `benchmarks export_board` counts with -Os."""

from motiondeck.export.figure import Figure
from motiondeck_base.errors import MotiondeckError, UnknownNameError

# Bytes of code; instructions of the worst tick: of any figure, more with each joint, and with each joint of a layer.
CORES = {
    "M4F": (16_700, 9_000, 1_250, 120),
    "M3": (20_100, 87_000, 30_000, 1_100),
    "M0+": (23_700, 205_000, 65_000, 2_200),
}
_PLAYER, _PLAYER_JOINT, _STACK, _STACK_JOINT = 712, 288, 720, 16  # bytes, with room for four layers


def cost_on(figure: Figure, board: str) -> dict[str, int]:
    """Flash and RAM, bytes, instructions of the worst tick, and more of them with a layer of all joints.

    The board is CORE:MHZ:RAM:FLASH, kB, of which the end may be left out. MotiondeckError if the figure does not fit.
    """
    (name, *given), joints = board.split(":"), len(figure.rest)
    [core] = UnknownNameError.indices("core", [name], [*CORES])
    code, base, joint, layer = [*CORES.values()][core]
    ram, worst = _PLAYER + _STACK + (_PLAYER_JOINT + _STACK_JOINT) * joints, base + joint * joints
    flash, has = code + len(figure.words), [float(one) if one.isdecimal() else 0.0 for one in given]
    needs = (1e-6 * worst * figure.rate, "MHz"), (1e-3 * ram, "kB of RAM"), (1e-3 * flash, "kB of flash")
    if short := [
        f"{need:.3g} {unit} of {most:g}" for (need, unit), most in zip(needs, has, strict=False) if need > most
    ]:
        raise MotiondeckError(f"{board}: at worst it takes {', '.join(short)}; take fewer motions or another board")
    return {"flash": flash, "ram": ram, "instructions": worst, "layer": layer * joints}
