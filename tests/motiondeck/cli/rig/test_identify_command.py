"""`motiondeck rig identify` as typed, on emulated servos in simulated time, and what it writes."""

import json
import os
import re
import signal
from types import SimpleNamespace

import pytest

from benchmarks.simulated_time import EmulatedPort
from command_line import invoked
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import load_rig
from hardware.rig.supervision.rig import Rig
from hardware.tools.identify import JointTrials, Response

PAN = (
    'name = "pan",  id = 1, model = "XL330-M288", direction = 1, zero = 2048, lower = -1.5, upper = 1.5, velocity = 4.0'
)
TILT = PAN.replace("pan", "tilt").replace("id = 1", "id = 2").replace("1.5", "1.0")
INLINE = f"""\
# a rig of my own {{ with braces }}
port = "/dev/ttyUSB0" # the adapter
baud = 1_000_000
rate_hz = 100.0
joints = [ # all of them
  {{ {PAN} }}, # "it pans" {{ }}
  {{ {TILT}, lag=0.3 }}, # it tilts, lag = 5
]
"""
HEADED = """\
port = "/dev/ttyUSB0"
baud = 1_000_000
rate_hz = 100.0
[[joints]]  # the first
name = "pan"
id = 1
model = "XL330-M288"
direction = 1
zero = 2048
lower = -1.5
upper = 1.5
velocity = 4.0
[[joints]]
name = "tilt"
id = 2
model = "XL330-M288"
direction = 1
zero = 2048
lower = -1.0
upper = 1.0
velocity = 4.0
lag = 0.3 # s
"""


@pytest.fixture
def bench(tmp_path, monkeypatch):
    """The emulated bus, its rig file, and what happens at which time."""
    bench = SimpleNamespace(file=tmp_path / "my.toml", deeds=[])
    bench.file.write_text(INLINE)
    bench.port = EmulatedPort(EmulatedBus(load_rig(bench.file)))

    def elapse(seconds):
        bench.port.elapse(seconds)
        while bench.deeds and bench.deeds[0][0] <= bench.port.now():
            bench.deeds.pop(0)[1]()

    def open_rig(config, ports):
        return Rig(config, lambda part: Bus(bench.port, part.baud), False, sleep=elapse, turns=lambda part: None)

    monkeypatch.setattr(Rig, "connect", open_rig)
    monkeypatch.setattr("motiondeck.cli.rig.identify.time", SimpleNamespace(monotonic=bench.port.now, sleep=elapse))
    return bench


@pytest.fixture
def measured(monkeypatch):
    """Joints of these names, here all, need not move: each answers with the same figures."""
    found, names, joint = Response(0.05, 0.99, 0.03, 0.02, 0.004), ["pan", "tilt"], JointTrials.joint

    def answered(trials, index):
        return found if ("pan", "tilt")[index] in names else joint(trials, index)

    monkeypatch.setattr(JointTrials, "joint", answered)
    return names


def without_what_was_written(file):
    """The text of a rig file without what was added and with the value that was replaced."""
    left, (pan, tilt) = file.read_text(), load_rig(file).joints
    for joint, key in ((pan, "lag"), (pan, "friction"), (tilt, "friction")):
        for start in (", ", "\n"):
            left = left.replace(f"{start}{key} = {getattr(joint, key):g}", "", 1)
    return left.replace(f"{tilt.lag:g}", "0.3")


@pytest.mark.thorough
def test_lag_and_friction_are_measured_and_written(bench):
    result = invoked("rig", "identify", bench.file)
    assert result.exit_code == 0, result.output
    pan, tilt = load_rig(bench.file).joints
    assert pan.lag == pytest.approx(0.05, abs=0.005)
    assert tilt.lag == pytest.approx(0.05, abs=0.005)
    assert 0.01 < pan.friction < 0.1
    assert f"pan                {pan.lag * 1e3:>3.0f} ms" in result.stdout
    errors = re.findall(r" A   ([\d.]+), ([\d.]+)$", result.stdout, flags=re.M)
    assert len(errors) == 2
    assert all(0.0 < float(after) < 0.3 * float(before) for before, after in errors)
    assert without_what_was_written(bench.file) == INLINE
    assert [device["torque_enable"] for device in bench.port.bus.devices] == [0, 0]


@pytest.mark.parametrize("text", [INLINE, HEADED])
def test_all_else_in_the_file_stays(bench, measured, text):
    bench.file.write_text(text)
    result = invoked("rig", "identify", bench.file)
    assert result.exit_code == 0, result.output
    kept = bench.file.with_name("my.toml.bak")
    assert kept.read_text() == text
    assert f"wrote {bench.file}; {kept} is what was there" in result.stdout
    assert [(joint.lag, joint.friction) for joint in load_rig(bench.file).joints] == [(0.05, 0.03)] * 2
    assert without_what_was_written(bench.file) == text
    assert [device["torque_enable"] for device in bench.port.bus.devices] == [0, 0]


def test_a_dry_run_writes_nothing_and_json_has_the_figures(bench, measured, tmp_path):
    result = invoked("rig", "identify", bench.file, "--joint", "tilt", "--dry-run", "--json")
    assert result.exit_code == 0, result.output
    figures = {"lag": 0.05, "gain": 0.99, "friction": 0.03, "before": 0.02, "after": 0.004}
    assert json.loads(result.stdout) == {"written": None, "joints": [{"name": "tilt", **figures}]}
    assert bench.file.read_text() == INLINE
    assert [path.name for path in tmp_path.iterdir()] == ["my.toml"]


def test_another_file_is_written_and_the_first_one_stays(bench, measured, tmp_path):
    result = invoked("rig", "identify", bench.file, "--joint", "pan", "--out", tmp_path / "new.toml")
    assert result.exit_code == 0, result.output
    assert bench.file.read_text() == INLINE
    pan, tilt = load_rig(tmp_path / "new.toml").joints
    assert pan.lag == 0.05
    assert tilt.lag == 0.3


def test_a_surprise_writes_nothing_and_takes_the_torque_off(bench, measured):
    measured.remove("tilt")
    bench.deeds.append((4.0, lambda: bench.port.bus.devices[1].bank.drive.jammed.__setitem__(1, True)))
    result = invoked("rig", "identify", bench.file)
    assert result.exit_code == 1
    assert "tilt (id 2)" in str(result.exception)
    assert "The joint was braked; nothing is written." in str(result.exception)
    assert "pan " in result.stdout
    assert bench.file.read_text() == INLINE
    assert [device["torque_enable"] for device in bench.port.bus.devices] == [0, 0]


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_brakes_and_writes_nothing(bench, number, code):
    before = signal.getsignal(number)
    bench.deeds.append((4.0, lambda: os.kill(os.getpid(), number)))
    result = invoked("rig", "identify", bench.file)
    assert result.exit_code == code
    assert "the joint was braked; nothing is written" in result.stderr
    assert bench.file.read_text() == INLINE
    assert bench.port.now() < 5.5
    assert signal.getsignal(number) is before
    assert [device["torque_enable"] for device in bench.port.bus.devices] == [0, 0]


def test_what_cannot_be_done_is_said_before_anything_moves(bench):
    result = invoked("rig", "identify", bench.file, "--joint", "plan")
    assert "unknown joint of this rig 'plan'" in str(result.exception)
    result = invoked("rig", "identify", "pan-tilt")
    assert "give a file with --out, or --dry-run" in str(result.exception)
    assert bench.port.sent == []
