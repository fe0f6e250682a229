import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.deck.interfaces import PlacedPose
from controller.deck.recorded_deck import RecordedDeck
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.stop_requests import StopRequest
from controller.wire.messages.commands import Blend, GiveBeat, Jump, Queue, SetTempo, Switch, Unlock
from controller.wire.messages.replies import Accepted, Event
from controller.wire.recorder import main, record
from controller.wire.run_recording import (
    RecordedEvent,
    RecordingWriter,
    RunRecording,
    check_replaceable,
    load_recording,
)
from controller.wire.telemetry import StateReader, StateWriter
from motiondeck_base.errors import FileFormatError, MotiondeckError

FIELDS = {"tick": 1, "targets": 2}
DESCRIPTION = {"motions": ["walk", "jog"], "rate": 100.0}


def rows(first, count):
    ticks = np.arange(first, first + count, dtype=float)
    return np.stack([ticks, 2 * ticks, -ticks], axis=1)


def write(path, chunks, *, close=True):
    writer = RecordingWriter(path, DESCRIPTION, FIELDS)
    first = 0
    for count in chunks:
        writer.append(rows(first, count))
        first += count
    if close:
        writer.close()
        writer.close()
    return writer


def test_what_is_written_is_read(tmp_path):
    write(tmp_path / "r", [3, 5])
    recording = load_recording(tmp_path / "r")
    assert (recording.description, recording.ticks, recording.complete) == (DESCRIPTION, 8, True)
    assert np.array_equal(recording.fields["targets"], rows(0, 8)[:, 1:])


def test_each_chunk_can_be_read_as_soon_as_it_is_written(tmp_path):
    writer = write(tmp_path / "r", [3], close=False)
    recording = load_recording(tmp_path / "r")
    assert (recording.ticks, recording.complete) == (3, False)
    writer.close()


@given(st.lists(st.one_of(st.integers(1, 5), st.text(max_size=9)), max_size=6))
def test_events_are_read_with_the_tick_that_they_came_after(tmp_path, deeds):
    """Numbers are ticks that are written at once, words the text of an event."""
    writer, last, told = RecordingWriter(tmp_path / "r", DESCRIPTION, FIELDS), -1, []
    for deed in deeds:
        if isinstance(deed, int):
            writer.append(rows(last + 1, deed))
            last += deed
        else:
            told.append(RecordedEvent(last, Event("fault", deed, "walk", 1.5, len(told))))
            writer.append_events(msgspec.json.encode(told[-1]) + b"\n")
    assert not load_recording(tmp_path / "r").complete
    writer.close()
    recording = load_recording(tmp_path / "r")
    assert (recording.ticks, [*recording.events], recording.complete) == (last + 1, told, True)


@given(st.lists(st.integers(1, 5), max_size=5), st.data())
def test_cut_anywhere_a_recording_loses_one_chunk_at_most(tmp_path, chunks, data):
    path = tmp_path / "r"
    write(path, chunks)
    whole = path.read_bytes()
    header = len(whole) - 8 * (len(chunks) + 1) - 24 * sum(chunks)
    cut = data.draw(st.integers(header, len(whole)))
    path.write_bytes(whole[:cut])
    recording = load_recording(path)
    ends = header + np.cumsum([0, *(8 + 24 * count for count in chunks)])
    kept = int(np.sum(np.array(chunks, dtype=int)[: np.searchsorted(ends, cut, side="right") - 1]))
    assert recording.ticks == kept
    assert np.array_equal(recording.fields["tick"][:, 0], np.arange(kept))
    assert recording.complete == (cut == len(whole))


@given(st.data())
def test_a_damaged_byte_is_noticed(tmp_path, data):
    path = tmp_path / "r"
    write(path, [2, 2])
    whole = bytearray(path.read_bytes())
    place = data.draw(st.integers(0, len(whole) - 9))
    whole[place] ^= data.draw(st.integers(1, 255))
    path.write_bytes(whole)
    try:
        recording = load_recording(path)
    except FileFormatError:
        return
    assert np.array_equal(recording.fields["tick"][:, 0], np.arange(recording.ticks))
    assert not recording.complete


@given(st.binary(max_size=80))
def test_any_file_is_a_recording_or_refused(tmp_path, data):
    for content in (data, b"MDRECORD" + data):
        (tmp_path / "r").write_bytes(content)
        with pytest.raises(FileFormatError, match="recording"):
            load_recording(tmp_path / "r")


def test_of_many_ticks_that_are_written_at_once_the_first_are_kept_when_the_disk_is_full(tmp_path):
    path = tmp_path / "run.rec"
    writer = RecordingWriter(path, {}, {"tick": 1})
    writer.append(np.arange(500.0)[:, None])
    os.truncate(path, path.stat().st_size // 2)
    kept = load_recording(path).fields["tick"][:, 0]
    assert 190 < len(kept) < 250
    np.testing.assert_array_equal(kept, np.arange(float(len(kept))))


def test_what_cannot_be_opened_is_said(tmp_path):
    with pytest.raises(FileFormatError, match="none: cannot be read"):
        load_recording(tmp_path / "none")
    with pytest.raises(FileFormatError, match="cannot be written"):
        RecordingWriter(tmp_path / "none" / "r", DESCRIPTION, FIELDS)


def test_another_version_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("controller.wire.run_recording.VERSION", 8)
    write(tmp_path / "r", [1])
    monkeypatch.undo()
    with pytest.raises(FileFormatError, match="version 8; this Motiondeck reads versions 1 to 7"):
        load_recording(tmp_path / "r")


@pytest.mark.parametrize("version", [1, 2, 3, 4, 5, 6])
def test_older_versions_are_still_read(tmp_path, monkeypatch, version):
    monkeypatch.setattr("controller.wire.run_recording.VERSION", version)
    write(tmp_path / "r", [1])
    monkeypatch.undo()
    assert load_recording(tmp_path / "r").ticks == 1


def test_readers_can_have_every_state_that_is_still_there(tmp_path):
    writer = StateWriter(tmp_path / "s", {}, {"x": 1}, slots=16)
    reader = StateReader(tmp_path / "s")
    assert reader.since(0)[1].shape == (0, 1)
    for value in range(1, 11):
        writer.publish(x=value)
    number, values = reader.since(0)
    assert (number, values[:, 0].tolist()) == (10, list(range(1, 11)))
    for value in range(11, 41):
        writer.publish(x=value)
    number, values = reader.since(number)
    assert (number, values[:, 0].tolist()) == (40, list(range(25, 41)))
    assert reader.since(number)[1].shape == (0, 1)


def test_the_recorder_records_all_that_is_left_when_the_deck_ends(tmp_path):
    writer = StateWriter(tmp_path / "s", DESCRIPTION, FIELDS, slots=100)
    for row in rows(0, 50):
        writer.publish(tick=row[0], targets=row[1:])
    writer.close()
    record(tmp_path / "s", tmp_path / "r")
    recording = load_recording(tmp_path / "r")
    assert (recording.ticks, recording.complete) == (50, True)


DYING_DECK = """
import os, signal, sys, time
from pathlib import Path
from controller.wire.telemetry import StateWriter
writer = StateWriter(Path(sys.argv[1]), {"motions": [], "rate": 100.0}, {"tick": 1, "targets": 2}, slots=1000)
for tick in range(200):
    writer.publish(tick=tick)
sys.stdin.readline()
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_deck_that_is_killed_leaves_a_whole_recording(tmp_path):
    state, out = tmp_path / "s", tmp_path / "r"
    deck = subprocess.Popen([sys.executable, "-c", DYING_DECK, str(state)], stdin=subprocess.PIPE)
    while not state.exists():
        time.sleep(0.02)
    recorder = subprocess.Popen([sys.executable, "-m", "controller.wire.recorder", str(state), str(out)])
    while not out.exists():
        time.sleep(0.02)
    deck.communicate(b"\n")
    assert recorder.wait(30.0) == 0
    recording = load_recording(out)
    assert (recording.ticks, recording.complete) == (200, True)


def test_without_a_deck_the_recorder_says_so(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("controller.wire.recorder.signal.signal", lambda *_: None)
    monkeypatch.setattr("controller.wire.recorder.os.nice", lambda _: 0)
    assert main(str(tmp_path / "none"), str(tmp_path / "r")) == 1
    assert "is the deck running" in capsys.readouterr().err


def recorded(ticks=101):
    time_s = np.arange(ticks) / 100.0
    turn = np.stack([np.cos(time_s), 0 * time_s, 0 * time_s, np.sin(time_s)], axis=1)
    turn[::2] *= -1.0  # the same rotations
    fields = {
        "targets": np.stack([time_s, -time_s], axis=1),
        "playing": (time_s[:, None] >= 0.5).astype(float),
        "root_position": np.stack([time_s, 0 * time_s, 1 + 0 * time_s], axis=1),
        "heading": np.angle(np.exp(1j * 8.0 * time_s))[:, None],
        "root_rotation": turn,
    }
    return RunRecording(DESCRIPTION, fields, True)


@pytest.mark.parametrize("dt", [0.01, 0.003])
def test_a_recorded_deck_plays_what_was_recorded_at_any_rate(dt):
    deck = RecordedDeck(recorded())
    for tick in range(1, int(0.99 / dt)):
        targets, pose = deck.update(dt)
        assert targets == pytest.approx([tick * dt, -tick * dt])
        assert pose.root_position[0] == pytest.approx(tick * dt)
        assert pose.heading == pytest.approx(8.0 * tick * dt)
        assert abs(pose.rotation[0, 0]) == pytest.approx(np.cos(tick * dt), abs=1e-4)
        assert deck.motion == deck.playing == ("jog" if tick * dt >= 0.5 else "walk")
    assert not deck.over
    targets = [deck.update(dt)[0] for _ in range(10)][-1]
    assert deck.over
    assert targets == pytest.approx([1.0, -1.0])


def test_a_recording_is_over_once_joints_that_lag_are_at_its_end():
    deck = RecordedDeck(recorded())
    deck.lead = 0.05
    ticks = next(tick for tick in range(1, 200) if (deck.update(0.01), deck.over)[1])
    assert ticks == pytest.approx(99 + 5, abs=2)
    deck.set_tempo(-1.0)
    for _ in range(100):
        deck.update(0.01)
    assert not deck.over


def test_the_same_robot_is_placed_where_it_was_and_another_one_by_the_pose():
    recording = recorded()
    place = np.column_stack([2.0 * recording.fields["root_position"], recording.fields["root_rotation"]])
    placed = RunRecording(DESCRIPTION, recording.fields | {"robot_root": place}, True)
    (_, same), (_, other) = (RecordedDeck(placed, same_robot=same).update(0.013) for same in (True, False))
    assert isinstance(same, PlacedPose)
    assert same.robot_root[:3] == pytest.approx(2.0 * same.root_position)
    assert same.robot_root[3:] == pytest.approx(same.rotation[0])
    assert not isinstance(other, PlacedPose)
    assert np.array_equal(other.rotation, same.rotation)


def test_a_recorded_deck_can_be_paused_and_played_slowly_but_not_switched():
    deck = RecordedDeck(recorded())
    deck.pause()
    held = [deck.update(0.01)[0] for _ in range(100)][-1]
    again, _ = deck.update(0.01)
    assert np.array_equal(held, again)
    deck.resume()
    deck.set_tempo(0.5)
    assert not deck.over
    moved = [deck.update(0.01)[0] for _ in range(100)][-1]
    assert 0.3 < moved[0] - held[0] < 0.52
    run, stop = CommandedRun(deck), StopRequest()
    for refused in (Switch("jog"), Queue("jog"), Blend("walk", "jog", 0.5), Jump(0.5), GiveBeat(), Unlock()):
        reply = run.carry_out(refused, stop, remote=False).reply
        assert reply.reason.startswith(f"'{refused.row.word}' is not for a replay, which takes: tempo")
    assert isinstance(run.carry_out(SetTempo(1.0), stop, remote=False).reply, Accepted)
    with pytest.raises(MotiondeckError, match="empty"):
        RecordedDeck(recorded(0))


def test_a_recording_that_cannot_even_begin_leaves_no_file(tmp_path):
    path, (soft, hard) = tmp_path / "run.rec", resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, hard))  # as a disk that is full after 10 bytes
    try:
        with pytest.raises(FileFormatError, match=r"run\.rec: cannot be written"):
            RecordingWriter(path, DESCRIPTION, FIELDS)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not path.exists()


def test_only_a_recording_of_a_run_is_recorded_over(tmp_path):
    older, mocap = tmp_path / "run.rec", tmp_path / "walk.bvh"
    RecordingWriter(older, DESCRIPTION, FIELDS).close()
    mocap.write_text("HIERARCHY\n")
    for free in (older, tmp_path / "new.rec", Path("/dev/full")):
        check_replaceable(free)
    with pytest.raises(FileFormatError, match=r"walk\.bvh: there is another file of this name"):
        check_replaceable(mocap)


def test_fields_of_versions_up_to_5_are_read_by_the_names_of_now(tmp_path, monkeypatch):
    monkeypatch.setattr("controller.wire.run_recording.VERSION", 5)
    old = ("tick", "time_s", "motion", "tempo", "blend", "blend_weight", "lock_stage", "seen", "confidence")
    writer = RecordingWriter(tmp_path / "old.rec", {}, dict.fromkeys(old, 1))
    writer.append(np.arange(9.0)[None])
    writer.close()
    read = load_recording(tmp_path / "old.rec").fields
    new = ("tick", "at", "playing", "tempo", "blend_motion", "blend_weight", "lock_state", "seen_motion")
    assert [read[name][0, 0] for name in (*new, "seen_confidence")] == list(range(9))
