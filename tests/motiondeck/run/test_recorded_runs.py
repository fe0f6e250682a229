"""Recording a run, replaying and plotting it, as its users do it."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import get_args

import msgspec
import numpy as np
import pytest
from hypothesis import given

import synthetic
from command_line import motiondeck
from command_strategies import commands
from controller.deck.recorded_deck import RecordedDeck
from controller.library.motion_library import save_library
from controller.wire.messages.command_table import RECORDED
from controller.wire.messages.commands import (
    Blend,
    GetStatus,
    Heartbeat,
    Jump,
    LockPhase,
    Pause,
    Queue,
    SetTempo,
    Switch,
)
from controller.wire.messages.deck_snapshot import LOCK_SOURCES, MODES, LockStage
from controller.wire.messages.replies import Accepted, Event
from controller.wire.run_recording import RecordedEvent, RecordingWriter, load_recording
from controller.wire.snapshot_numbers import SnapshotNumbers
from motiondeck.pictures.clip_scene import act_of_recording
from motiondeck.run.beside.tick_recorder import TickRecorder
from motiondeck_base.shipped import find_robot
from shipped_libraries import shipped
from sim.physics.kinematic_playback import KinematicPlayback
from sim.robots.robot import load_robot

TIMELINE = """
motion = "march"
[[commands]]
at = 0.1
say = "blend march wave 0.1"
[[commands]]
at = 0.3
say = "queue wave"
[[commands]]
at = 0.4
say = "tempo 1.5"
[[commands]]
at = 1.8
say = "estop"
[[commands]]
at = 1.9
say = "bow"
[[commands]]
at = 2.4
say = "reset"
[[commands]]
at = 2.5
say = "resume"
"""


def started(*arguments):
    """A command that runs on its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "motiondeck.cli.main", *map(str, arguments)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def printed(command):
    """What a command printed, once it has ended well."""
    out, error = command.communicate(timeout=110)
    assert command.returncode == 0, error
    return out


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    save_library(synthetic.small_library(), folder / "small.safetensors")
    (folder / "show.toml").write_text(TIMELINE)
    return folder


@pytest.fixture(scope="module")
def runs(folder):
    """Two runs at once: they mostly wait for their time to pass."""
    show = started(
        *("play", "--library", folder / "small.safetensors", "--headless", "--command-port", "0", "--seconds", "3"),
        *("--rate", "100", "--script", folder / "show.toml", "--record", folder / "show.rec", "--json"),
    )
    servo = started(
        *("play", "walk", "--robot", "servo20", "--headless", "--kinematic", "--command-port", "0", "--seconds", "1.5"),
        *("--rate", "100", "--record", folder / "servo.rec", "--recognize", "--lock-to", "body", "--json"),
    )
    return json.loads(printed(show)), json.loads(printed(servo))


@pytest.fixture(scope="module")
def run(runs):
    return runs[0]


@given(commands())
def test_any_command_is_noted_with_its_first_number_or_its_motion(message):
    """One that cannot be noted would be refused after it was carried out."""
    fields = {name: np.zeros(1) for name in ("command", "argument", "refused")}
    recorder = TickRecorder(
        SimpleNamespace(fields=fields), SnapshotNumbers([]), ["walk", "jog"], None, Path(), Path(), -1
    )
    recorder.note(message, Accepted(message.id))
    assert fields["command"][0] == message.row.record
    match message:
        case Switch(to="jog") | Queue(to="jog"):
            assert fields["argument"][0] == 1.0
        case SetTempo(factor=number) | Blend(weight=number) | Jump(phase=number) | LockPhase(phase=number):
            assert fields["argument"][0] == number
        case Pause() | GetStatus() | Heartbeat():
            assert np.isnan(fields["argument"][0])


@pytest.mark.thorough
def test_every_tick_is_recorded_with_its_commands(run, folder):
    recording = load_recording(folder / "show.rec")
    fields = recording.fields
    assert recording.complete
    assert fields["tick"][:, 0].tolist() == list(range(run["ticks"]))
    given = [RECORDED[int(n)] for n in fields["command"][:, 0] if n]
    assert given == ["blend", "queue", "tempo", "estop", "switch", "reset", "resume"]
    assert run["refused"] == [{"at": 1.9, "reason": "the emergency stop is on; release it with: reset"}]
    assert [MODES[int(m)] for m in np.unique(fields["mode"])] == ["playing", "held", "emergency stop"]
    blended = fields["blend_motion"][:, 0] >= 0.0
    assert blended.any()
    assert set(fields["blend_motion"][blended, 0]) == {1.0}  # wave
    assert np.isnan(fields["blend_motion"][:, 1:]).all()
    assert np.nanmax(fields["blend_weight"][:, 0]) == pytest.approx(0.1)
    halted = fields["targets"][fields["mode"][:, 0] == MODES.index("emergency stop")]
    assert np.array_equal(halted[-1], halted[-5])
    assert np.isfinite(fields["measured"][5:]).all()


@pytest.mark.thorough
def test_events_are_recorded_at_the_ticks_where_the_loop_changed(run, folder):
    """By the modes that the loop wrote in every tick: an event is of that tick or the next, where it is noticed."""
    recording = load_recording(folder / "show.rec")
    modes, ticks = recording.fields["mode"][:, 0], recording.fields["tick"][:, 0]
    changes = ticks[1:][np.diff(modes) != 0.0]
    told = [one for one in recording.events if one.event.kind == "mode"]
    assert len(changes) >= 3
    assert len(told) == len(changes)
    assert {one.tick + 1 - change for one, change in zip(told, changes, strict=True)} <= {0.0, 1.0}
    assert [one.event.number for one in recording.events] == [*range(1, len(recording.events) + 1)]
    assert recording.events[-1].event == msgspec.structs.replace(
        recording.events[-1].event, kind="ended", text=run["reason"]
    )


@pytest.mark.thorough
def test_a_recording_is_replayed(run, folder):
    replay = started(
        *("replay", folder / "show.rec", "--library", folder / "small.safetensors", "--headless", "--kinematic"),
        *("--command-port", "0", "--json"),
    )
    report = json.loads(printed(replay))
    assert report["reason"] == "played to the end"
    assert sum(report["limited"].values()) < 0.25 * report["ticks"]  # of 24 targets a tick


def test_a_replay_says_what_was_blended(servo_run):
    names = tuple(servo_run.description["motions"])
    assert RecordedDeck(servo_run).blend == ()
    blend, weights = np.full((servo_run.ticks, 3), -1.0), np.zeros((servo_run.ticks, 3))
    blend[:, :2], weights[:, :2] = [names.index("jog"), names.index("waltz")], [0.3, 0.2]
    blended = replace(servo_run, fields=servo_run.fields | {"blend_motion": blend, "blend_weight": weights})
    assert RecordedDeck(blended).blend == (("jog", 0.3), ("waltz", 0.2))
    older = {name: values for name, values in servo_run.fields.items() if not name.startswith("blend")}
    assert RecordedDeck(replace(servo_run, fields=older)).blend == ()


@pytest.fixture(scope="module")
def servo_run(runs, folder):
    """A run of a robot that is placed by its feet, with what its joints looked like."""
    return load_recording(folder / "servo.rec")


def test_a_robot_that_is_placed_by_its_feet_is_replayed_where_it_was(servo_run):
    library = shipped()
    root = servo_run.fields["robot_root"]
    assert np.allclose(np.linalg.norm(root[:, 3:], axis=1), 1.0)
    # On its own steps it comes less far, and its height is its own.
    walked, path = np.ptp(root[:, 0]), np.ptp(servo_run.fields["root_position"][:, 0])
    assert 0.0 < walked < path
    robot = load_robot(find_robot("servo20"), library.skeleton)
    stage, deck = KinematicPlayback(robot), RecordedDeck(servo_run)
    for tick in range(1, servo_run.ticks):
        stage.write(*deck.update(0.01))
        assert stage.qpos[:7] == pytest.approx(root[tick], abs=1e-9)
    act = act_of_recording(servo_run, robot)
    assert act.qpos[-1, :3] == pytest.approx(root[(len(act.qpos) - 1) * 2, :3])
    assert act.stands.shape[1] == 2


def test_what_was_recognized_is_recorded(servo_run):
    seen, confidence = servo_run.fields["seen_motion"][:, 0], servo_run.fields["seen_confidence"][:, 0]
    motions, known = servo_run.description["motions"], np.isfinite(seen)
    assert motions.index("walk") in seen
    assert set(seen[known]) <= {*range(len(motions))}
    assert ((confidence[known] >= 0.0) & (confidence[known] < 1.0)).all()


def test_what_the_phase_was_locked_to_is_recorded(servo_run, run, folder):
    assert set(servo_run.fields["lock_source"][:, 0]) == {LOCK_SOURCES.index("body")}
    # Its second half: a busy machine that misses ticks makes it wait for the body for a moment.
    half = servo_run.ticks // 2
    locked = servo_run.fields["lock_state"][half:, 0] == get_args(LockStage).index("locked")
    assert locked.mean() > 0.5
    assert np.median(np.abs(servo_run.fields["lock_error_ms"][half:, 0][locked])) < 80.0
    free = load_recording(folder / "show.rec").fields
    assert np.isnan(free["lock_source"]).all()
    assert np.isnan(free["lock_error_ms"]).all()


def test_a_recording_is_plotted(run, folder):
    pytest.importorskip("matplotlib")
    done = motiondeck("plot", folder / "show.rec", "--out", folder / "show.png")
    assert done.returncode == 0, done.stderr
    assert (folder / "show.png").read_bytes()[:4] == b"\x89PNG"
    assert "7 commands" in done.stdout
    figures = json.loads(motiondeck("plot", folder / "show.rec", "--json").stdout)
    assert (figures["ticks"], figures["lost_ticks"], figures["refused"]) == (run["ticks"], 0, 1)
    assert figures["events"][-1]["kind"] == "ended"


def test_what_went_wrong_in_a_recording_is_printed(run, folder):
    recording = load_recording(folder / "show.rec")
    sizes = {name: values.shape[1] for name, values in recording.fields.items()}
    writer = RecordingWriter(folder / "wrong.rec", recording.description, sizes)
    writer.append(np.hstack([*recording.fields.values()]))
    for tick, kind, text in (
        (49, "fault", "rig: knee is hot"),
        (99, "settled", "walk"),
        (149, "fell", "it has fallen"),
    ):
        writer.append_events(msgspec.json.encode(RecordedEvent(tick, Event(kind, text))) + b"\n")
    writer.close()
    done = motiondeck("plot", folder / "wrong.rec")
    said = [line for line in done.stdout.splitlines() if line.startswith("at ")]
    assert said == ["at 0.50 s fault: rig: knee is hot", "at 1.50 s fell: it has fallen"], done.stderr


def test_a_run_that_is_killed_leaves_what_it_did(folder):
    out = folder / "killed.rec"
    deck = subprocess.Popen(
        [
            *(sys.executable, "-m", "motiondeck.cli.main", "play", "--library", str(folder / "small.safetensors")),
            *("--headless", "--command-port", "0", "--rate", "100", "--record", str(out)),
        ],
        stdin=subprocess.DEVNULL,
    )
    try:
        deadline = time.monotonic() + 30.0
        while not out.exists() or out.stat().st_size < 20_000:
            assert time.monotonic() < deadline, "nothing is recorded"
            time.sleep(0.05)
        os.kill(deck.pid, signal.SIGKILL)
        deck.wait()
        while not load_recording(out).complete:
            assert time.monotonic() < deadline, "the recorder does not notice that the deck is gone"
            time.sleep(0.05)
    finally:
        deck.kill()
        deck.wait()
    ticks = load_recording(out).fields["tick"][:, 0]
    assert ticks.tolist() == list(range(len(ticks)))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("replay", "none.rec"), "none.rec: cannot be read"),
        (("plot", "pyproject.toml"), "this is not a recording"),
        (("play", "--headless", "--record", "none/x.rec", "--command-port", "0"), "none/x.rec: cannot be written"),
        (("play", "--video", "x.mp4", "--record", "x.rec"), "no ticks to record"),
        (("play", "--headless", "--script", "none.toml"), "none.toml: cannot be read"),
    ],
)
def test_a_mistake_ends_in_one_line(arguments, says):
    done = motiondeck(*arguments)
    assert done.returncode == 1
    assert says in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
