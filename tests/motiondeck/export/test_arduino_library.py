"""The exported Arduino library, compiled against a stub of the board and of the maker's library: no real board."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import arduino_boards
from command_line import motiondeck
from controller.wire.messages.commands import Blend, EmergencyStop, Jump, Pause, Queue, Reset, Resume, SetTempo, Switch
from hardware.rig.rig_file import load_rig
from motiondeck.export.c_folder import write_arduino
from motiondeck.export.golden import deck_trace
from motiondeck_base.errors import MotiondeckError

pytestmark = pytest.mark.skipif(shutil.which("c++") is None, reason="no C++ compiler")

SCRIPT = {
    30: ("switch loop1", Switch("loop1")),
    80: ("loop2 direct", Switch("loop2", direct=True)),
    160: ("tempo 1.5 0.5", SetTempo(1.5, 0.5)),
    230: ("queue shot3", Queue("shot3")),
    420: ("jump 0.25", Jump(0.25)),
    440: ("blend loop1 loop2 0.4", Blend("loop1", "loop2", 0.4)),
    470: ("pause", Pause()),
    520: ("resume", Resume()),
    600: ("estop", EmergencyStop()),
    640: ("loop0", Switch("loop0")),
    660: ("reset", Reset()),
    661: ("switch loop0", Switch("loop0")),
}
TICKS = 1000


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    return arduino_boards.written(tmp_path_factory.mktemp("rig"))


@pytest.fixture(scope="module", params=[False, True], ids=["float", "fixed"])
def exported(rig, tmp_path_factory, request):
    folder = tmp_path_factory.mktemp("library")
    return arduino_boards.exported(rig, folder, fixed=request.param), folder


def lines_of(folder, sketch, tmp_path, script, ticks):
    """What a board with a sketch writes that gets (tick, text)."""
    board = arduino_boards.compiled(folder, sketch, tmp_path)
    sent = "".join(f"{tick} {text}\n" for tick, text in script)
    return subprocess.run(
        [board, str(ticks)], input=sent, capture_output=True, text=True, check=True
    ).stdout.splitlines()


def goals_in(lines):
    return np.array([line.split()[1:] for line in lines if line.startswith("goals")], dtype=float)


@pytest.mark.thorough
def test_lines_of_goals_are_those_of_the_deck(exported, tmp_path):
    figure, folder = exported
    lines = lines_of(folder, "SerialGoals", tmp_path, [(tick, text) for tick, (text, _) in SCRIPT.items()], TICKS)
    deck = deck_trace(figure, [(tick, command) for tick, (_, command) in SCRIPT.items()], TICKS)
    assert np.abs(goals_in(lines) - 1e3 * deck.safe).max() < 1.5
    replies = [line for line in lines if not line.startswith("goals")]
    assert replies == [
        "ok" if taken else "refused: the emergency stop is on: reset releases it" for taken in deck.accepted
    ]
    assert deck.accepted.count(False) == 1


@pytest.mark.thorough
def test_servos_get_their_pulses_and_torque_where_they_stand(exported, rig, tmp_path):
    figure, folder = exported
    lines = lines_of(folder, "Dynamixel", tmp_path, [(150, "loop1")], 400)
    assert [line for line in lines if "WRONG" in line] == []
    joints = load_rig(rig).joints
    measured = np.float32([joint.angle(2000 + joint.id) for joint in joints]).astype(float)
    deck = deck_trace(figure, [(150, Switch("loop1"))], 400, measured)
    servos = [(number, servo) for number, joint in enumerate(joints) for servo in joint.servos]
    expected = np.column_stack(
        [servo.zero + deck.safe[:, number] * servo.pulses_per_radian for number, servo in servos]
    )
    assert len(servos) == 4
    assert np.abs(goals_in(lines) - expected).max() < 1.2


@pytest.mark.thorough
def test_what_cannot_be_carried_out_is_refused_with_the_reason(exported, tmp_path):
    asked = {
        "waltz": "unknown; one of: MOTION, switch, queue, blend, tempo",
        "switch waltz": "there is no such motion",
        "queue": "there is no such motion",
        "tempo fast": "a number is missing or out of its range",
        "tempo 9": "a number is missing or out of its range",
        "jump": "a number is missing or out of its range",
        "heartbeat -1": "a number is missing or out of its range",
        "reset": "a number is missing or out of its range",
        "x" * 63: "unknown",
    }
    script = [*enumerate([*asked, "y" * 500, "status"], 3)]
    lines = lines_of(exported[1], "SerialGoals", tmp_path, script, 40)
    *replies, status = (line for line in lines if not line.startswith("goals"))
    for (text, reason), reply in zip(asked.items(), replies, strict=True):
        assert reply.startswith(f"refused: {reason}"), text
    assert status.startswith("playing: loop0 0")
    assert status.endswith("motions: loop0 loop1 loop2 shot3 shot4")


def test_only_rigs_of_such_servos_are_driven(exported, tmp_path):
    so101 = load_rig(Path(__file__).parents[3] / "configs/rigs/so101.toml")
    with pytest.raises(MotiondeckError, match="drives Dynamixel servos"):
        write_arduino(exported[0], so101, tmp_path)
    told = motiondeck("export", "thesis15", "--robot", "servo20", "--for", "arduino", "--out", tmp_path).stderr
    assert "name its file with --rig" in told
