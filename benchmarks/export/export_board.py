"""What an exported player costs on Cortex-M: instructions a tick, flash, RAM.

Compiled by arm-none-eabi-gcc and run by qemu-system-arm (both of Debian), which counts instructions; never on a board.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from msgspec import structs

from benchmarks.command import run
from controller.deck.interfaces import JointLimits
from controller.library.motion_library import MotionLibrary
from controller.motion.encodings.joint_angles import JointAngles, JointBody
from controller.networks.clip.network import ClipPlayer
from controller.networks.keys import Keys
from motiondeck.export.c_folder import write_c
from motiondeck.export.figure import Figure, words_of
from motiondeck.export.source import open_figure

HERE = Path(__file__).parent
CORES = {  # flags of the compiler, and the machine that runs it
    "M4F": ("-mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard", "mps2-an386"),
    "M3": ("-mcpu=cortex-m3", "mps2-an385"),
    "M0+": ("-mcpu=cortex-m0plus", "mps2-an385"),  # an M3 runs its instructions
}


def of_joints(figure: Figure, count: int) -> Figure:
    """The figure with so many joints, the first ones or all again and again."""
    old, network = figure.library, figure.library.network
    assert isinstance(network, ClipPlayer)
    assert network.keys is not None
    among = np.arange(count) % len(figure.rest)
    keys = {
        name: Keys.of((one.unit * one.counted[:, among]).astype(float), int(one.course[1]), int(one.course[2]))
        for name, one in network.keys.items()
    }
    loops = {one.name: one.plays == "loop" for one in old.info.motions}
    played = ClipPlayer.of_keys(keys, {one.name: one.frames for one in old.info.motions}, loops)
    played.every = network.every
    encoding = JointAngles(JointBody.of([f"joint{number}" for number in range(count)]))
    info = structs.replace(old.info, skeleton=encoding.skeleton_info())
    library = MotionLibrary(info, played, encoding)
    limits = JointLimits(
        **{one.name: getattr(figure.limits, one.name)[among] for one in fields(figure.limits)},
    )
    words = words_of(library, limits, figure.rate, fixed=figure.fixed)
    return replace(figure, library=library, limits=limits, rest=figure.rest[among], words=words)


def measured(figure: Figure, core: str, level: str, layers: int, folder: Path) -> dict[str, int]:
    """Instructions, stack and sizes in bytes of a figure's player on a core.

    Code is all of the player, whether or not it is called here, and what it takes of the libraries.
    """
    write_c(figure, folder)
    for name in ("_board.c", "_board.ld"):
        shutil.copy(HERE / name, folder)
    flags, machine = CORES[core]
    joints = f"-DLAYERS={layers}"
    source, language = ("player.cpp", ["-fno-exceptions"]) if figure.fixed else ("player.c", ["-std=gnu99"])
    common = ["arm-none-eabi-gcc", *flags.split(), "-mthumb", *language, f"-O{level}", "-ffp-contract=off", joints]
    common += ["-ffunction-sections", "-fdata-sections", "-fno-math-errno"]
    subprocess.run([*common, "-c", "_board.c"], cwd=folder, check=True)
    objects = [source, "_board.o", "-T", "_board.ld", "-nostartfiles", "-Wl,--gc-sections", "-lm", "-lc", "-lgcc"]
    subprocess.run([*common, *objects, "-o", "board.elf"], cwd=folder, check=True)
    size = subprocess.run(
        ["arm-none-eabi-size", "board.elf", "_board.o"], cwd=folder, check=True, capture_output=True, text=True
    )
    text, board = (int(line.split()[0]) for line in size.stdout.splitlines()[1:])  # the board's has the figure
    words = ["qemu-system-arm", "-M", machine, "-nographic", "-semihosting", "-icount", "shift=0"]
    done = subprocess.run(
        [*words, "-kernel", "board.elf"], cwd=folder, check=True, capture_output=True, text=True, timeout=900
    )
    found = {name: int(value) for name, value in re.findall(r"^(\w+) (\d+)$", done.stdout + done.stderr, re.MULTILINE)}
    return found | {"code": text - board, "ram": found["player"] + found["stack"]}


def main(
    figures: Annotated[list[str] | None, typer.Argument(help="Libraries and robots, as thesis15:servo20.")] = None,
    motions: Annotated[str, typer.Option(help="Some of their motions, with commas between.")] = "",
    cores: Annotated[str, typer.Option(help="Which cores, with commas between.")] = ",".join(CORES),
    joints: Annotated[int, typer.Option(help="So many joints, the figure's again and again; 0: as it is.")] = 0,
    layers: Annotated[int, typer.Option(help="Layers that play.")] = 0,
    fixed: Annotated[bool, typer.Option(help="In fixed-point numbers.")] = False,
    level: Annotated[str, typer.Option(help="Optimisation of the compiler: 2 for speed, s for size.")] = "2",
) -> None:
    """Measures players on emulated cores."""
    for name in figures or ["thesis15:servo20", "cmu86:servo20"]:
        library, _, robot = name.partition(":")
        figure = open_figure(library, robot, None, [one for one in motions.split(",") if one], fixed=fixed)
        figure = of_joints(figure, joints) if joints else figure
        largest = max(figure.bytes_of.values())
        print(f"{name}: {len(figure.rest)} joints, {len(figure.words)} bytes, a motion at most {largest}")
        for core in cores.split(","):
            with tempfile.TemporaryDirectory() as folder:
                found = measured(figure, core, level, layers, Path(folder))
            print(f"  {core}: " + ", ".join(f"{key} {value}" for key, value in found.items()))


if __name__ == "__main__":
    run("export_board", main)
