"""Settings of servos in a file: an earlier backup stays."""

from contextlib import nullcontext

import pytest

from benchmarks.simulated_time import EmulatedPort
from command_line import invoked
from controller.loop.safety import compiled_envelope
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import load_rig
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_rig


def test_a_backup_never_replaces_an_earlier_one(tmp_path):
    """It may hold the settings from before `rig doctor --fix`, of which there is no other copy."""
    file = tmp_path / "servos.json"
    file.write_text("[]")
    with pytest.raises(MotiondeckError, match=r"servos\.json exists already"):
        invoked("rig", "backup", "servo20", "--out", str(file), catch_exceptions=False)
    assert file.read_text() == "[]"
    with pytest.raises(MotiondeckError, match="there is no such folder"):
        invoked("rig", "backup", "servo20", "--out", str(tmp_path / "no" / "s.json"), catch_exceptions=False)


def test_what_the_doctor_sets_is_saved_before_and_can_be_undone(tmp_path, monkeypatch):
    config = load_rig(find_rig("pan-tilt"))
    port = EmulatedPort(EmulatedBus(config))
    pan = port.bus.devices[0]
    pan["homing_offset"], pan["secondary_id"] = 40, 2
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(
        "motiondeck.cli.rig.commands.open_buses",
        lambda config, ports: nullcontext([(config, Bus(port, config.baud))]),
    )
    (tmp_path / "envelope.so").touch()
    monkeypatch.setattr(compiled_envelope, "COMPILED", tmp_path / "envelope.so")
    fixed = invoked("rig", "doctor", "pan-tilt", "--fix")
    assert "\nnote: the compiled safety envelope is not of this source" in fixed.stdout
    assert (pan["homing_offset"], pan["secondary_id"]) == (0, 255)
    (saved,) = (tmp_path / "motiondeck" / "settings").iterdir()
    assert f"to undo what was set: motiondeck rig restore pan-tilt {saved}" in fixed.stderr
    assert invoked("rig", "restore", "pan-tilt", str(saved)).exit_code == 0
    assert (pan["homing_offset"], pan["secondary_id"]) == (40, 2)
    assert len(list(saved.parent.iterdir())) == 1
