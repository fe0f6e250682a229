"""LeRobot's own Feetech bus on an emulated SO-101 arm, step by step.

It goes over the maker's SDK. PYTHON is an interpreter with lerobot (0.4 or newer; PyTorch is not needed: pip install
--no-deps lerobot) and, for it, feetech-servo-sdk, pyserial, deepdiff and tqdm. The exit code is 1 if a step gives
something else than it should. The tests of the emulator have rustypot's controller.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from benchmarks import command
from benchmarks.rig import _lerobot_client
from hardware.emulator.process import start_emulator
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import write_file
from motiondeck_base.shipped import shipped_configs

_CLIENT = "import sys; sys.path.insert(0, sys.argv[1]); import _lerobot_client; _lerobot_client.main(sys.argv[2])"
_NUMBER, _PRESENT = 777, 3000  # of the model; where each horn is at first, so that homing has something to do


def run(python: Path) -> dict[str, object]:
    """What each of LeRobot's steps gave."""
    text = (shipped_configs() / "rigs" / "so101.toml").read_text().replace("zero = 2048", f"zero = {_PRESENT}")
    text = text.replace("lower = -2.7", "lower = -1.5").replace("upper = 2.7", "upper = 1.5")
    text = text.replace("lower = -1.9, upper = 1.9", "lower = -1.6, upper = 1.6").replace("1.7,", "1.6,")
    with tempfile.TemporaryDirectory() as folder:
        write_file(rig := Path(folder) / "arm.toml", text.encode())
        with start_emulator(rig) as emulator:
            program = [str(python), "-c", _CLIENT, str(Path(_lerobot_client.__file__).parent), emulator.port]
            done = subprocess.run(program, capture_output=True, text=True, timeout=120, check=False)
    if done.returncode:
        raise MotiondeckError(f"LeRobot's client has failed:\n{done.stderr[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1])


def wrong(found: dict[str, object]) -> list[str]:
    """The steps that gave something else than they should."""
    names = _lerobot_client.NAMES
    ids = {str(id): _NUMBER for id, _ in enumerate(names, 1)}
    expected: dict[str, object] = {
        "connect": True, "ping": _NUMBER, "broadcast_ping": ids, "configured": [16] * len(names),
        "homing": dict.fromkeys(names, _PRESENT - 2047), "centred": dict.fromkeys(names, 2047),
        "velocity": dict.fromkeys(names, 0),
    }  # fmt: skip
    problems = [
        f"{step}: {found.get(step)}, not {right}" for step, right in expected.items() if found.get(step) != right
    ]
    moved = found.get("moved")
    if not isinstance(moved, dict) or any(abs(moved[name] - 2300) > 3 for name in names):
        problems.append(f"moved: {moved}, not 2300")
    return problems


def main(python: Annotated[Path, typer.Argument(metavar="PYTHON", help="An interpreter that has lerobot.")]) -> None:
    """Runs LeRobot's bus, and names the steps that went wrong."""
    found = run(python)
    for step, gave in found.items():
        print(f"{step:16} {gave}")
    if problems := wrong(found):
        raise MotiondeckError("; ".join(problems))
    print("all as it should be")


if __name__ == "__main__":
    command.run("feetech_clients", main, __doc__)
