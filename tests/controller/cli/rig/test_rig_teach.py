"""From a hand on an emulated rig of two ports to a network that plays it: teach, play the clip, fit, play on."""

import json
import os
import signal
import subprocess
import sys
from contextlib import nullcontext

import msgspec
import numpy as np
import pytest
from typer.testing import CliRunner

from controller.cli.main import app
from controller.cli.rig.play import play_clip
from controller.cli.session.session import RunSettings
from controller.mocap.encodings.joint_angles import angles_of, read_taught_clip, save_taught_clip, taught_clip
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.port import EmulatedPort
from hardware.errors import SerialPortError
from hardware.rig.joined_rig import JoinedRig
from hardware.rig.rig_file import load_rig
from hardware.rig.supervised_rig import SupervisedRig
from hardware.tools.teaching import Moment

LIMITS = "zero = 2048, lower = -1.5, upper = 1.5, velocity = 4.0"
RIG = f"""
port = "/dev/nowhere"
baud = 1000000
rate_hz = 50
joints = [
  {{ name = "pan", id = 1, port = "/dev/elsewhere", model = "XM430-W350", direction = 1, {LIMITS} }},
  {{ name = "tilt", id = 1, model = "XM430-W350", direction = -1, {LIMITS} }},
]
"""


def motiondeck(*words):
    result = CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout.splitlines()[-1])


def diagnosed(*words):
    result = CliRunner().invoke(app, ["rig", "doctor", *map(str, words), "--json"], catch_exceptions=False)
    return json.loads(result.stdout.splitlines()[-1])


@pytest.fixture
def rig(tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text(RIG)
    return path


@pytest.fixture
def port(rig, tmp_path):
    link = tmp_path / "port"
    command = [sys.executable, "-m", "controller.cli.main", "rig", "emulate", str(rig), "--link", str(link)]
    process = subprocess.Popen([*command, "--fault", "hand:value=0.5"], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    ports = [process.stdout.readline().strip() for _ in range(2)]
    assert ports == [f"{link}-1", f"{link}-2"]
    yield ("--port", ports[0], "--port", ports[1])
    process.terminate()
    process.wait()


def test_a_hand_teaches_and_the_network_plays_on(rig, port, tmp_path):
    clip, library = tmp_path / "wave.clip", tmp_path / "gestures.safetensors"
    said = motiondeck("rig", "teach", rig, "--out", clip, *port, "--seconds", "4", "--json")
    assert (said["joints"], said["beyond_limits"]) == (["pan", "tilt"], [])
    angles = angles_of(read_taught_clip(clip).rotation[:, 1:])
    assert angles.max(axis=0) == pytest.approx([0.5, 0.0], abs=0.02)
    assert angles.min(axis=0) == pytest.approx([0.0, -0.5], abs=0.02)

    run = motiondeck("rig", "play", rig, clip, *port, "--command-port", "0", "--json")
    assert run["reason"] == "played to the end"
    assert run["rig"]["tracking_rmse_rad"] < 0.1

    assert motiondeck("rig", "stop", rig, *port, "--json") == {"off": ["pan", "tilt"], "unconfirmed": []}
    assert [len(one["servos"]) for one in diagnosed(rig, *port)["ports"]] == [1, 1]

    said = motiondeck("fit", clip, "--out", library, "--json")
    assert said["network"] == "centralized"
    assert said["motions"][0]["passed"]
    words = ("rig", "play", rig, library, "wave", *port, "--command-port", "0", "--seconds", "3", "--json")
    run = motiondeck(*words)
    assert run["rig"]["tracking_rmse_rad"] < 0.1
    assert run["faults"] == {"deck": 0, "commands": 0, "telemetry": 0}


def test_sigterm_ends_a_run_on_the_rig_without_torque_and_with_its_report(rig, port, tmp_path, monkeypatch):
    clip = tmp_path / "sway.clip"
    sway = 0.4 * np.sin(np.linspace(0.0, 12 * np.pi, 1500))
    save_taught_clip(taught_clip("sway", ("pan", "tilt"), 50.0, np.stack([sway, -sway], axis=1)), clip)
    writes = []

    def write(self, targets, send=JoinedRig.write):
        writes.append(targets)
        if len(writes) == 20:
            os.kill(os.getpid(), signal.SIGTERM)
        send(self, targets)

    monkeypatch.setattr(JoinedRig, "write", write)
    run = motiondeck("rig", "play", rig, clip, *port, "--command-port", "0", "--json")
    assert run["reason"] == "SIGTERM received"
    assert len(writes) >= 20
    torques = [servo["torque"] for one in diagnosed(rig, *port)["ports"] for servo in one["servos"]]
    assert torques == [False, False]


def test_one_port_that_is_gone_does_not_keep_the_others_from_being_switched_off(rig, port):
    words = ["rig", "stop", str(rig), *port[:2], "--port", "/dev/nowhere", "--json"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 1
    assert json.loads(result.stdout) == {"off": ["pan"], "unconfirmed": ["tilt"]}
    assert "/dev/nowhere" in result.stderr
    assert "not confirmed by tilt. Cut the power." in result.stderr


def test_a_clip_that_the_limits_hold_back_comes_to_its_last_frame(rig, tmp_path, monkeypatch):
    clip = tmp_path / "jerk.clip"
    angles = np.zeros((12, 1))
    angles[6:] = 1.2  # in one frame of 20 ms; the joint may do 4 rad/s
    save_taught_clip(taught_clip("jerk", ("tilt",), 50.0, angles), clip)
    config = msgspec.structs.replace(load_rig(rig), joints=load_rig(rig).joints[1:])
    port = EmulatedPort(EmulatedBus(config))
    connected = SupervisedRig(config, lambda: Bus(port, config.baud), beside=False)

    def write(targets):
        port.elapse(1.0 / config.rate_hz)
        SupervisedRig.write(connected, targets)

    monkeypatch.setattr(connected, "write", write)
    monkeypatch.setattr("hardware.rig.joined_rig.connect_rig", lambda config, ports: connected)
    run = play_clip(config, [], read_taught_clip(clip), RunSettings(rate=config.rate_hz))
    assert run["reason"] == "played to the end"
    assert connected._rig.goals == pytest.approx([1.2], abs=0.005)


@pytest.mark.parametrize(
    ("end", "said"), [(SerialPortError("the port is gone."), "the port is gone"), (SystemExit(143), "ended by SIGTERM")]
)
def test_a_recording_that_breaks_off_is_saved_as_far_as_it_goes(rig, tmp_path, monkeypatch, end, said):
    clip = tmp_path / "wave.clip"

    def watch(config, parts, sleep):
        for tick in range(100):
            yield Moment(0.02 * tick, np.array([0.5 * np.sin(0.06 * tick), 0.0]))
        raise end

    monkeypatch.setattr("controller.cli.rig.teach.open_buses", lambda config, ports: nullcontext([]))
    monkeypatch.setattr("hardware.tools.teaching.watch_hands", watch)
    words = ["rig", "teach", str(rig), "--out", str(clip), "--seconds", "60", "--json"]
    result = CliRunner().invoke(app, words)
    assert (result.exit_code, json.loads(result.stdout)["frames"]) == (1, len(read_taught_clip(clip)))
    assert said in json.loads(result.stdout)["cut_short"]
    assert said in result.stderr


def test_prompts_leave_stdout_to_the_answer(rig, tmp_path, monkeypatch):
    def watch(config, parts, sleep):
        return (Moment(0.02 * tick, np.array([0.5 * np.sin(0.06 * tick), 0.0])) for tick in range(100))

    monkeypatch.setattr("controller.cli.rig.teach.open_buses", lambda config, ports: nullcontext([]))
    monkeypatch.setattr("controller.cli.rig.teach._wait_for_enter", lambda done: None)
    monkeypatch.setattr("hardware.tools.teaching.watch_hands", watch)
    words = ["rig", "teach", str(rig), "--out", str(tmp_path / "wave.clip"), "--json"]
    result = CliRunner().invoke(app, words, input="\n\n")
    assert json.loads(result.stdout)["joints"] == ["pan", "tilt"]
    assert "hold what would fall" in result.stderr


def test_what_cannot_be_taught_or_played_is_said(rig, tmp_path):
    other = tmp_path / "other.clip"
    save_taught_clip(taught_clip("other", ("pan", "grip"), 50.0, np.zeros((60, 2))), other)
    for words, error in (
        (("rig", "teach", rig, "--out", tmp_path / "wave.txt"), "ends in .clip"),
        (("rig", "teach", rig, "--out", tmp_path / "no" / "wave.clip"), "no such folder"),
        (("rig", "teach", rig, "--out", tmp_path / "a.clip", "--seconds", "0"), "not between"),
        (("rig", "play", rig, other), "'grip'"),
        (("rig", "play", rig, other, "wave"), "no motion 'wave' to choose"),
        (("rig", "play", rig, "thesis15", "wlak"), "unknown motion 'wlak'"),
        (
            ("fit", other, rig, "--out", tmp_path / "x.safetensors"),
            "other.clip: a recording, not a recipe",
        ),
        (("fit", rig, "--out", tmp_path / "x.safetensors"), "arm.toml"),
        (("fit", other, "--data", tmp_path, "--out", tmp_path / "x.safetensors"), "--data .* is for the recordings"),
        (("rig", "emulate", rig, "--root", "free"), "--root free is about a body"),
    ):
        with pytest.raises(Exception, match=error) as raised:
            CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
        assert any(kind.__name__ == "MotiondeckError" for kind in type(raised.value).__mro__)


def test_a_fault_of_one_model_among_others_ends_the_run_with_its_name_and_exit_code_1(rig, tmp_path, monkeypatch):
    one_port = RIG.replace("elsewhere", "nowhere").replace('"XM430-W350"', '"XL330-M288"', 1)
    rig.write_text(one_port.replace('"tilt", id = 1', '"tilt", id = 2'))
    clip = tmp_path / "sway.clip"
    sway = 0.3 * np.sin(np.linspace(0.0, 12 * np.pi, 500))
    save_taught_clip(taught_clip("sway", ("pan", "tilt"), 50.0, np.stack([sway, -sway], axis=1)), clip)
    config = load_rig(rig)
    port = EmulatedPort(EmulatedBus(config))
    writes = []

    def write(self, targets, send=SupervisedRig.write):
        writes.append(targets)
        if len(writes) == 20:
            port.bus[1].fail(32)
        send(self, targets)

    connected = SupervisedRig(config, lambda: Bus(port, config.baud), beside=False)
    monkeypatch.setattr(SupervisedRig, "write", write)
    monkeypatch.setattr("hardware.rig.joined_rig.connect_rig", lambda config, ports: connected)
    result = CliRunner().invoke(app, ["rig", "play", str(rig), str(clip), "--command-port", "0", "--seconds", "4"])
    assert result.exit_code == 1
    assert len(writes) <= 22
    assert "rig: pan (id 1) has shut down: overload" in result.stdout
    assert "the rig has stopped: pan (id 1) has shut down: overload" in result.stdout
