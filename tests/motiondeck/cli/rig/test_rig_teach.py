"""Teaching an emulated rig by hand, and playing what it was taught, on two ports."""

import json
import os
import re
import signal
import subprocess
import sys
from contextlib import nullcontext

import numpy as np
import pytest

from command_line import invoked
from controller.motion.formats.taught_clip import read_taught_clip, save_taught_clip, taught_clip
from hardware.errors import SerialPortError
from hardware.rig.rig_file import load_rig
from hardware.rig.scale import RigScale
from hardware.tools.teaching import Moment
from motiondeck.run.guard.guarded_rig import GuardedRig
from served_rigs import served
from waiting import tried

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
    result = invoked(*words, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout.splitlines()[-1])


def diagnosed(*words):
    result = invoked("rig", "doctor", *words, "--json", catch_exceptions=False)
    return json.loads(result.stdout.splitlines()[-1])


@pytest.fixture
def rig(tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text(RIG)
    return path


@pytest.fixture
def port(rig, tmp_path):
    link = tmp_path / "port"
    command = [sys.executable, "-m", "motiondeck.cli.main", "rig", "emulate", str(rig), "--link", str(link)]
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    ports = [process.stdout.readline().strip() for _ in range(2)]
    assert ports == [f"{link}-1", f"{link}-2"]
    yield ("--port", ports[0], "--port", ports[1])
    process.terminate()
    process.wait()


@pytest.mark.thorough
def test_sigterm_ends_a_run_on_the_rig_without_torque_and_with_its_report(rig, port, tmp_path, monkeypatch):
    clip = tmp_path / "sway.clip"
    sway = 0.4 * np.sin(np.linspace(0.0, 12 * np.pi, 1500))
    save_taught_clip(taught_clip("sway", ("pan", "tilt"), 50.0, np.stack([sway, -sway], axis=1)), clip)
    writes = []

    def write(self, targets, send=GuardedRig.write):
        writes.append(targets)
        if len(writes) == 20:
            os.kill(os.getpid(), signal.SIGTERM)
        send(self, targets)

    monkeypatch.setattr(GuardedRig, "write", write)
    rig.write_text(RIG.replace("/dev/elsewhere", port[1]).replace("/dev/nowhere", port[3]))
    run = motiondeck("play", clip, "--rig", rig, "--headless", "--command-port", "0", "--json")
    assert run["reason"] == "stopped from outside (SIGTERM)"
    assert len(writes) >= 20
    torques = [servo["torque"] for one in diagnosed(rig, *port)["ports"] for servo in one["servos"]]
    assert torques == [False, False]


def test_one_port_that_is_gone_does_not_keep_the_others_from_being_switched_off(rig, port):
    words = ["rig", "stop", str(rig), *port[:2], "--port", "/dev/nowhere", "--json"]
    result = invoked(*words)
    assert result.exit_code == 1
    assert json.loads(result.stdout) == {"off": ["pan"], "unconfirmed": ["tilt"]}
    assert "/dev/nowhere" in result.stderr
    assert "not confirmed by tilt. Cut the power." in result.stderr


@pytest.mark.thorough
def test_a_clip_that_the_limits_hold_back_comes_to_its_last_frame(rig, tmp_path):
    one = RIG.replace('  { name = "pan", id = 1, port = "/dev/elsewhere"', '# { name = "pan"')
    clip = tmp_path / "jerk.clip"
    angles = np.zeros((12, 1))
    angles[6:] = 1.2  # in one frame of 20 ms; the joint may do 4 rad/s
    save_taught_clip(taught_clip("jerk", ("tilt",), 50.0, angles), clip)
    rig.write_text(one)
    config = load_rig(rig)

    def play():
        with served(config) as (servos, port):
            rig.write_text(one.replace("/dev/nowhere", port))
            run = motiondeck("play", clip, "--rig", rig, "--headless", "--command-port", "0", "--json")
            goal = RigScale(config).angles(np.array([servos[1]["goal_position"]]))
        assert run["reason"] == "played to the end"
        assert goal == pytest.approx([1.2], abs=0.005)

    tried(play)


@pytest.mark.parametrize(
    ("end", "said"), [(SerialPortError("the port is gone."), "the port is gone"), (SystemExit(143), "ended by SIGTERM")]
)
def test_a_recording_that_breaks_off_is_saved_as_far_as_it_goes(rig, tmp_path, monkeypatch, end, said):
    clip = tmp_path / "wave.clip"

    def watch(config, parts, sleep):
        for tick in range(100):
            yield Moment(0.02 * tick, np.array([0.5 * np.sin(0.06 * tick), 0.0]))
        raise end

    monkeypatch.setattr("motiondeck.cli.rig.teach.open_buses", lambda config, ports: nullcontext([]))
    monkeypatch.setattr("hardware.tools.teaching.watch_hands", watch)
    words = ["rig", "teach", str(rig), "--out", str(clip), "--seconds", "60", "--json"]
    result = invoked(*words)
    assert (result.exit_code, json.loads(result.stdout)["frames"]) == (1, len(read_taught_clip(clip)))
    assert said in json.loads(result.stdout)["cut_short"]
    assert said in result.stderr


class Somebody:
    """Types what a script says, a line for each question and one for each recording; stands in for `LineInput`."""

    def __init__(self, lines):
        self.lines = list(lines)

    def __call__(self):
        return self

    def ask(self, what):
        print(what, file=sys.stderr)
        return self.lines.pop(0)

    def take(self, seconds=0.0):
        return None


@pytest.fixture
def session(rig, tmp_path, monkeypatch):
    """Runs `rig teach` by a script, with hands that make one motion after the other; angles (T, 2), rad."""

    def run(out, lines, motions, *options):
        motions = iter(motions)

        def watch(config, parts, sleep):
            return (Moment(0.02 * tick, angles) for tick, angles in enumerate(next(motions)))

        monkeypatch.setattr("motiondeck.cli.rig.teach.open_buses", lambda config, ports: nullcontext([]))
        monkeypatch.setattr("motiondeck.cli.rig.teach.LineInput", Somebody(lines))
        monkeypatch.setattr("hardware.tools.teaching.watch_hands", watch)
        return invoked("rig", "teach", str(rig), "--out", str(out), *options)

    return run


def wave(frequency=0.6, still=0.0):
    """A hand that waves, after a time without movement, s."""
    t = np.maximum(0.0, np.arange(250) / 50.0 - still)
    return np.stack([0.5 * np.sin(2 * np.pi * frequency * t), 0.2 * (1 - np.cos(2 * np.pi * frequency * t))], axis=1)


def reach():
    """A hand that moves a joint to somewhere else."""
    t = np.clip(np.arange(250) / 50.0 - 1.0, 0.0, 1.0)
    return np.stack([0.8 * t**2 * (3 - 2 * t), 0.0 * t], axis=1)


def test_motions_are_named_recorded_again_and_taken_several_times(session, tmp_path):
    lines = [
        "", "wa ve", "wave", "", "again", "", "take", "", "drop",  # recorded, again, a first take, a second one dropped
        "reach", "", "whole", "trim", "what", "loop", "once", "",
        "",
    ]  # fmt: skip
    result = session(tmp_path, lines, [reach(), wave(), wave(0.5), reach()])
    assert result.exit_code == 0, result.output
    assert sorted(file.name for file in tmp_path.glob("*.clip")) == ["reach.clip", "wave.clip"]
    assert "\nmotion 'wa ve' cannot be typed" in result.stderr
    assert "unknown choice 'what'" in result.stderr
    assert tuple(read_taught_clip(tmp_path / f"{name}.clip").plays for name in ("wave", "reach")) == ("loop", "once")
    assert "wave.2: 5.0 s of 5.0 s, loop" in result.stderr
    assert re.search(r"note: it is 0\.\d\d rad from the average of 2 takes", result.stderr)


def test_takes_are_numbered_and_another_motion_among_them_is_named(session, tmp_path):
    lines = ["", "", "take", "", "take", "", ""]
    result = session(tmp_path / "wave.clip", lines, [wave(), wave(0.55), wave()[:, ::-1] * [1, 2]], "--loop")
    assert sorted(file.name for file in tmp_path.glob("*.clip")) == ["wave.2.clip", "wave.3.clip", "wave.clip"]
    assert "is not the motion of" in result.stderr


def test_a_name_that_was_used_before_gets_another_take_and_loses_nothing(session, tmp_path):
    folder = tmp_path / "gestures"  # which is made
    session(folder, ["", "wave", "", "", ""], [wave()])
    before = (folder / "wave.clip").read_bytes()
    result = session(folder, ["", "wave", "", "", ""], [wave(0.55)])
    assert "wave.clip exists already: this will be another take of it, wave.2.clip" in result.stderr
    assert (folder / "wave.clip").read_bytes() == before
    assert (folder / "wave.2.clip").exists()


def test_another_take_is_learned_as_the_one_before_it(session, tmp_path):
    """`learn` refuses takes of which one is a loop and another is not."""
    lines = ["", "wave", "", "once", "take", "", "", "wave", "", "", ""]
    session(tmp_path, lines, [wave(), wave(0.55), wave(0.6)])
    assert [read_taught_clip(tmp_path / f"wave{take}.clip").plays for take in ("", ".2", ".3")] == ["once"] * 3


@pytest.mark.parametrize(("option", "seconds", "left"), [("--trim", 4.2, True), ("--no-trim", 5.0, False)])
def test_what_is_trimmed_is_told_and_can_be_kept(session, tmp_path, option, seconds, left):
    result = session(tmp_path / "wave.clip", ["", "", ""], [wave(still=1.0)], option)
    assert result.exit_code == 0, result.output
    assert read_taught_clip(tmp_path / "wave.clip").duration == pytest.approx(seconds, abs=0.1)
    said = r"left out: 0\.[678] s before the first movement; `whole` or --no-trim keeps it"
    assert bool(re.search(said, result.stderr)) == left
    assert f"wrote {tmp_path / 'wave.clip'}" in result.stdout


def test_taught_clips_are_learned_with_a_recipe_that_can_be_edited(tmp_path):
    clip, library, recipe = (tmp_path / name for name in ("wave.clip", "hands.safetensors", "hands.toml"))
    save_taught_clip(taught_clip("wave", ("pan", "tilt"), 50.0, wave(0.5)), clip)
    result = invoked("learn", str(clip), "--out", str(library), "--json")
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert said["motions"][0]["plays"] == "loop"
    assert said["learned_from"]["wave"]["to_s"] < 4.9
    assert "exists already" in str(invoked("learn", str(clip), "--out", str(library)).exception)
    recipe.write_text("loop_keeps = 1.0\n" + recipe.read_text())
    again = json.loads(invoked("learn", str(recipe), "--out", str(library), "--force", "--json").stdout)
    assert again["learned_from"]["wave"]["to_s"] > 4.9


def test_prompts_leave_stdout_to_the_answer(session, tmp_path):
    result = session(tmp_path / "reach.clip", ["", "", ""], [reach()], "--json")
    said = json.loads(result.stdout)
    assert (said["joints"], said["plays"], said["recorded_seconds"]) == (["pan", "tilt"], "once", pytest.approx(5.0))
    assert "hold what would fall" in result.stderr


def test_what_cannot_be_taught_or_played_is_said(rig, tmp_path):
    any_port = ("--command-port", "0")
    other = tmp_path / "other.clip"
    save_taught_clip(taught_clip("other", ("pan", "grip"), 50.0, np.zeros((60, 2))), other)
    for words, error in (
        (("rig", "teach", rig, "--out", tmp_path / "wave.txt"), "ends in .clip"),
        (("rig", "teach", rig, "--out", tmp_path / "no" / "wave.clip"), "no such folder"),
        (("rig", "teach", rig, "--out", tmp_path / "no" / "wave.toml"), "no such folder"),
        (("rig", "teach", rig, "--out", rig), "unknown key 'port'"),
        (("rig", "teach", rig, "--out", tmp_path / "a.clip", "--seconds", "0"), "not between"),
        (("rig", "teach", rig, "--out", tmp_path, "--seconds", "3"), "give it a file, not the folder"),
        (("play", other, "--rig", rig, "--headless", *any_port), "'grip'"),
        (("play", other, "--rig", rig, "--script", "wave 2", *any_port), "give either a motion"),
        (("play", "wlak", "--rig", rig, "--headless", *any_port), "unknown motion 'wlak'"),
        (("learn", other, rig, "--out", tmp_path / "x.safetensors"), "give one recipe alone, or recordings"),
        (("learn", rig, "--out", tmp_path / "x.safetensors"), "arm.toml"),
        (("learn", other, "--data", tmp_path, "--out", tmp_path / "x.safetensors"), "--data .* no recipe is given"),
        (("rig", "emulate", rig, "--root", "free"), "--root free needs a body"),
    ):
        with pytest.raises(Exception, match=error) as raised:
            invoked(*words, catch_exceptions=False)
        assert any(kind.__name__ == "MotiondeckError" for kind in type(raised.value).__mro__)


def test_a_fault_of_one_model_among_others_ends_the_run_with_its_name_and_exit_code_1(rig, tmp_path):
    one_port = RIG.replace("elsewhere", "nowhere").replace('"XM430-W350"', '"XL330-M288"', 1)
    rig.write_text(one_port.replace('"tilt", id = 1', '"tilt", id = 2'))
    clip = tmp_path / "sway.clip"
    sway = 0.3 * np.sin(np.linspace(0.0, 12 * np.pi, 500))
    save_taught_clip(taught_clip("sway", ("pan", "tilt"), 50.0, np.stack([sway, -sway], axis=1)), clip)
    text = rig.read_text()

    def play():
        writes = []

        def fail(bus):
            writes.append(any(device.moving for device in bus.devices))
            if sum(writes) == 20:
                bus[1].fail(32)

        rig.write_text(text)
        with served(load_rig(rig), fail) as (_, port):
            rig.write_text(text.replace("/dev/nowhere", port))
            words = ("--headless", "--command-port", "0", "--seconds", "4")
            result = invoked("play", str(clip), "--rig", str(rig), *words)
        assert result.exit_code == 1
        assert "rig: pan (id 1) has shut down: overload" in result.stdout
        assert "the rig has stopped: pan (id 1) has shut down: overload" in result.stdout

    tried(play)
