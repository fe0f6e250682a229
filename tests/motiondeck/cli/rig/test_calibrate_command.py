"""`motiondeck rig calibrate`, `scan`, `setup` and `import` as typed, on emulated servos in simulated time."""

import json
import re
from contextlib import nullcontext

import msgspec
import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from command_line import invoked
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.handling import Handling
from hardware.rig.rig_file import load_rig
from hardware.tools.rig_writing import save_rig
from motiondeck_base.shipped import find_rig


class Somebody:
    """Types what a script says, and moves the joints meanwhile; stands in for `LineInput`.

    A step of the script is a line to type, or what to do before the next: ("hands", words, s) or a function.
    """

    def __init__(self, config, port, script):
        self.hands, self.port, self.script = Handling(config), port, list(script)
        self.asked = []

    def __call__(self):
        return self

    def ask(self, what):
        self.asked.append(what)
        while (line := self.take()) is None:
            pass
        return line

    def take(self, seconds=0.0):
        step = self.script.pop(0)
        if isinstance(step, str):
            return step
        if callable(step):
            step()
            return None
        _, words, lasts = step
        if words:
            self.hands.command(words)
        if lasts > 0.0:
            self.script.insert(0, ("hands", "", lasts - 0.05))
            self.port.elapse(0.05)
            self.hands.move([self.port.bus], self.port.now())
        return None


@pytest.fixture
def rig(tmp_path):
    """A rig file of two joints of which only ids and models are right."""
    true = load_rig(find_rig("pan-tilt"))
    joints = [msgspec.structs.replace(joint, lower=-3.1, upper=3.1) for joint in true.joints]
    save_rig(msgspec.structs.replace(true, joints=tuple(joints)), tmp_path / "rig.toml")
    return tmp_path / "rig.toml"


@pytest.fixture
def calibrate(rig, tmp_path, monkeypatch):
    """Runs the command by a script; the result, and what was asked."""
    config = load_rig(rig)
    port = EmulatedPort(EmulatedBus(config))

    def run(*script):
        somebody = Somebody(config, port, script)
        monkeypatch.setattr("motiondeck.cli.rig.calibrate.LineInput", somebody)
        monkeypatch.setattr(
            "motiondeck.cli.rig.calibrate.open_buses",
            lambda config, ports: nullcontext([(config, Bus(port, config.baud))]),
        )
        monkeypatch.setattr("motiondeck.cli.rig.calibrate.SAVE_S", 0.0)
        result = invoked("rig", "calibrate", str(rig), "--out", str(tmp_path / "my.toml"))
        return result, somebody.asked

    run.port = port
    return run


def interrupt():
    raise KeyboardInterrupt


def test_ranges_are_kept_over_a_pulled_cable_and_ctrl_c(calibrate, tmp_path):
    part, out = tmp_path / "my.toml.part", tmp_path / "my.toml"
    assert calibrate(interrupt)[0].stderr == "\nmotiondeck: ended by Ctrl-C.\n"  # before anything was measured
    result, asked = calibrate("", "", ("hands", "move pan 1.1 in 0.2", 0.3), calibrate.port.unplug, ("hands", "", 0.1))
    assert result.exit_code == 1
    assert "the same command continues from there" in str(result.exception)
    assert [question.split(":")[0] for question in asked] == [
        "The torque goes off", "Put every joint where its angle is 0, then press Enter "
    ]  # fmt: skip
    calibrate.port.wire.faults.unplugged = False
    result, asked = calibrate("", ("hands", "move pan -0.9 in 0.2", 0.3), interrupt)
    assert result.exit_code == 130
    assert "the same command continues from there" in result.stderr
    assert "continuing from" in result.stdout
    assert len(asked) == 1  # the zeros are known
    assert not out.exists()
    result, _ = calibrate("", "", ("hands", "move tilt 0.8 in 0.2", 0.3), ("hands", "move tilt -0.7 in 0.2", 0.3), "")
    assert result.exit_code == 0, result.output
    assert "1 of 2 joints are measured" in result.stdout
    assert "tilt move it to both ends. Type `keep` to leave it as before." in result.stdout
    assert not part.exists()
    found = load_rig(out)
    assert [(joint.lower, joint.upper) for joint in found.joints] == [
        pytest.approx((-0.88, 1.08), abs=4e-3), pytest.approx((-0.68, 0.78), abs=4e-3)
    ]  # fmt: skip


def test_what_is_typed_while_measuring_is_obeyed_or_explained(calibrate, tmp_path):
    result, _ = calibrate(
        "", "", ("hands", "move pan 1.1 in 0.2", 0.3), "reverse pan", "zero pan", "again pan", "zero elbow", "what",
        ("hands", "move pan 0.2 in 0.2", 0.3), "keep",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    for said in (
        "pan is reversed",
        "pan is at 0 here",
        "pan starts again",
        "no joint 'elbow'",
        "unknown command 'what'",
    ):
        assert said in result.stdout
    assert "note: tilt move it to both ends, it stays as it was." in result.stdout
    pan, tilt = load_rig(tmp_path / "my.toml").joints
    assert (pan.direction, pan.zero) == (-1, pytest.approx(2048 + 1.1 * 4096 / (2 * np.pi), abs=2))
    assert (pan.lower, pan.upper) == pytest.approx((0.0, 0.88), abs=4e-3)
    assert (tilt.lower, tilt.upper) == (-3.1, 3.1)


def test_a_servo_that_falls_silent_does_not_end_the_calibration(calibrate):
    def fall_silent():
        calibrate.port.bus[2].dead = True

    result, _ = calibrate(
        "", "", fall_silent, ("hands", "move pan 1 in 0.2", 0.3), ("hands", "move pan -1 in 0.2", 0.3), "keep"
    )
    assert result.exit_code == 0
    assert re.search(r"^tilt .*does not answer$", result.stdout, flags=re.M)


def test_scan_setup_and_import_write_rig_files_with_the_lasting_name_of_the_port(rig, tmp_path, monkeypatch):
    config = load_rig(rig)
    port = EmulatedPort(EmulatedBus(config))

    def open_bus(name, baud):
        port.bus.baud = baud
        return Bus(port, baud)

    monkeypatch.setattr("hardware.bus.servo_bus.Bus.open", open_bus)
    monkeypatch.setattr("hardware.bus.port.lasting_name", {"/dev/ttyUSB0": "/dev/serial/by-id/U2D2"}.__getitem__)

    def run(*words):
        return invoked("rig", *words)

    assert run("scan", "/dev/ttyUSB0", "--out", tmp_path / "new.toml").exit_code == 0
    assert load_rig(tmp_path / "new.toml").port == "/dev/serial/by-id/U2D2"
    assert "exists already" in str(run("scan", "/dev/ttyUSB0", "--out", tmp_path / "new.toml").exception)
    motors = {
        joint.name: {"id": joint.id, "drive_mode": 0, "homing_offset": 0, "range_min": 1000, "range_max": 3000}
        for joint in config.joints
    }
    (tmp_path / "koch.json").write_text(json.dumps(motors))
    result = run("import", tmp_path / "koch.json", "--port", "/dev/ttyUSB0", "--out", tmp_path / "arm.toml")
    assert result.exit_code == 0, result.output
    assert load_rig(tmp_path / "arm.toml").names == ("pan", "tilt")
    assert "Next: motiondeck rig doctor" in result.stdout
    port.bus[2].dead = True
    result = run("setup", "/dev/ttyUSB0", "--id", 7, "--rig", rig)
    assert result.exit_code == 0, result.output
    assert "its port is /dev/serial/by-id/U2D2" in result.stdout
    assert load_rig(rig).port == "/dev/serial/by-id/U2D2"
