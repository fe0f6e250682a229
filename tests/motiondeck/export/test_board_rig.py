"""A board as a rig: sketches on a stub of a board, at a pseudo-terminal, and the computer that plays them."""

import itertools
import json
import random
import shutil
import subprocess
import sys
from contextlib import contextmanager

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import arduino_boards
from benchmarks.export._c_player import beyond_limits
from command_line import motiondeck
from controller.library.motion_library import save_library
from controller.loop.safety.compiled_envelope import safety_envelope
from hardware.errors import RigError
from hardware.rig.rig_file import load_rig
from hardware.rig.supervision.board_rig import ANSWER, GOALS, BoardRig, line_of, read_line
from hardware.rig.supervision.servo_states import CONDITIONS
from motiondeck.run.guard.guard import RigGuard
from motiondeck.run.guard.messages import Targets
from waiting import tried

thorough = pytest.mark.thorough
needs_compiler = pytest.mark.skipif(shutil.which("c++") is None, reason="no C++ compiler")
angles_of = st.lists(st.floats(-80.0, 80.0), min_size=1, max_size=8).map(np.array)


@given(angles_of, st.integers(0, 3))
def test_a_line_is_read_as_it_was_written(angles, number):
    line = line_of(ANSWER, angles, number)
    read, alerts, same = read_line(line.rstrip(), len(angles))
    assert np.abs(read - angles).max() <= 10.1e-6
    assert (alerts.any(), same) == (False, number)
    assert read_line(line.rstrip(), len(angles) + 1) is None


@given(angles_of, st.data())
def test_a_damaged_line_is_none(angles, data):
    line = bytearray(line_of(GOALS, angles, 0).rstrip())
    place, letter = data.draw(st.integers(0, len(line) - 1)), data.draw(st.integers(0, 255))
    if data.draw(st.booleans()):
        del line[place : place + data.draw(st.integers(1, 9))]
    elif line[place] != letter:
        line[place] = letter
    else:
        return
    assert read_line(bytes(line), len(angles)) is None


@given(st.binary(max_size=60))
def test_garbage_is_none(data):
    assert read_line(data, 3) is None


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    return arduino_boards.written(tmp_path_factory.mktemp("rig"))


@pytest.fixture(scope="module")
def programs(rig, tmp_path_factory):
    folder = tmp_path_factory.mktemp("library")
    figure, made = arduino_boards.exported(rig, folder, limited=True), {}
    for sketch in ("SerialGoals", "Dynamixel"):
        (folder / sketch).mkdir()
        made[sketch] = arduino_boards.compiled(folder, sketch, folder / sketch)
    return figure, made


@contextmanager
def board(programs, rig, sketch="SerialGoals", **changes):
    """A port to a board with a sketch, and the rig that it is."""
    with arduino_boards.board_port(programs[1][sketch]) as port:
        yield port, BoardRig(msgspec.structs.replace(load_rig(rig), **changes), port)
    assert [line for line in port.said if "WRONG" in line] == []


def play(port, rig, targets):
    """Gives targets (T, J), one a tick; where the joints then were, (T, J)."""
    path = []
    for row in targets:
        rig.collect_state()
        rig.write(row)
        port.run()
        path.append(rig.positions.copy())
    return np.array(path)


def wave(rig, ticks, size=0.2):
    return rig.goals + size * (1.0 - np.cos(0.05 * np.arange(ticks)))[:, None]


@thorough
@needs_compiler
@pytest.mark.parametrize("sketch", ["SerialGoals", "Dynamixel"])
def test_goals_are_played_and_answered(programs, rig, sketch):
    with board(programs, rig, sketch) as (port, one):
        targets = wave(one, 300)
        path = play(port, one, targets)
        off = [np.abs(path[lag:] - targets[: len(targets) - lag])[20:].max() for lag in (1, 2)]
        assert min(off) < (1e-4 if sketch == "SerialGoals" else 1e-3)  # half a pulse of a servo is 0.8 mrad
        assert (one.report.faults, one.recoveries, list(one.incidents)) == (0, 0, [])
        assert one.close() == []


@thorough
@needs_compiler
def test_no_goal_breaks_a_limit(programs, rig):
    rng = np.random.default_rng(3)
    with board(programs, rig) as (port, one):
        start = one.goals.copy()
        targets = np.repeat(rng.uniform(-5.0, 5.0, (40, 3)), rng.integers(1, 60, 40), axis=0)
        path = play(port, one, targets)
        assert np.abs(path - start).max() > 2.0
        # Answers are rounded to 20 urad, of which the third difference takes eight halves: 2 % of what jerk allows.
        assert beyond_limits(programs[0], start, path) < 0.03
        assert one.faults.clipped.sum() > 0


@thorough
@needs_compiler
@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_damage_of_the_line_is_outlived(programs, rig, seed):
    """Bytes get lost, changed and added, in both directions; what comes whole is played, within the limits."""
    rng = random.Random(seed)

    def damaged(data):
        place = rng.randrange(len(data) + 1)
        noise = bytes(rng.randrange(256) for _ in range(rng.randrange(9)))
        other = bytearray(data)
        if data:
            other[rng.randrange(len(data))] = rng.randrange(63, 127)  # as letters of a line are
        kinds = [data[:place], data[:place] + noise + data[place:], noise + data, data[:place] + noise, bytes(other)]
        return rng.choice([data, data, data, *kinds, bytes(other), bytes(other)])

    with board(programs, rig) as (port, one):
        port.damage = port.lose = damaged
        play(port, one, wave(one, 200, 0.5))
        port.damage = port.lose = lambda data: data
        calm = play(port, one, np.repeat(one.goals[None] + 0.1, 250, axis=0))
        assert np.abs(calm[-1] - one.goals).max() < 1e-4
        assert one.close() == []
        path = np.array([line.split()[1:] for line in port.written.split(b"\n") if line.startswith(b"goals")], float)
    limits = programs[0].limits  # lines of goals are in mrad, rounded
    assert np.abs(np.diff(path, 1, axis=0)).max() <= 10.0 * limits.velocity.max() + 1.0
    assert np.abs(np.diff(path, 2, axis=0)).max() <= 0.1 * limits.acceleration.max() + 2.0


@thorough
@needs_compiler
def test_a_whole_line_is_read_behind_any_garbage(programs, rig):
    with board(programs, rig) as (port, one):

        @settings(max_examples=60, deadline=None)
        @given(garbage=st.binary(max_size=200), cuts=st.lists(st.integers(0, 60), max_size=3), off=st.floats(-0.5, 0.5))
        def judged(garbage, cuts, off):
            data, places = garbage + line_of(GOALS, one.positions + off, 0), sorted(cuts)
            for start, end in itertools.pairwise([0, *places, len(data)]):  # it comes in pieces
                port.send(data[start:end])
                port.run()
            port.run()
            assert sum(text.startswith(ANSWER) for text in port.receive().split(b"\n")) == 1

        judged()


@thorough
@needs_compiler
def test_a_dead_computer_leaves_the_joints_held_until_a_command(programs, rig):
    with board(programs, rig) as (port, one):
        play(port, one, wave(one, 120))
        moving = one.positions.copy()
        for _ in range(100):  # watchdog_ms is 200
            port.run()
        later = tell(port, one, wave(one, 1)[0])
        held = later.copy()
        assert 0.0 < np.abs(held - moving).max() < 0.5
        port.receive()
        assert "held" in answer(port, "status")
        for _ in range(50):
            port.run()
        assert np.abs(tell(port, one, one.goals) - held).max() < 3e-5
        assert answer(port, "jump 2").startswith("refused")
        assert answer(port, "loop1") == "ok"
        for _ in range(300):
            port.run()
        assert "playing" in answer(port, "status")


@thorough
@needs_compiler
def test_a_computer_that_was_away_begins_where_the_joints_are_held(programs, rig):
    with board(programs, rig) as (port, one):
        play(port, one, wave(one, 120))
        for _ in range(60):
            port.run()
        one.write(one.goals + 0.5)
        port.run()
        held = one.positions.copy() if one.collect_state() else None
        assert one.recoveries == 1
        assert np.array_equal(one.goals, held)
        assert "has got no goals in time" in one.incidents[-1].what
        path = play(port, one, held + 0.3 * np.clip(np.linspace(-0.2, 1.5, 300), 0, 1)[:, None] * np.ones(3))
        assert np.abs(path[-1] - held - 0.3).max() < 1e-4
        assert np.abs(np.diff(path, axis=0)).max() < 0.02


@thorough
@needs_compiler
def test_the_emergency_stop_is_the_boards_too(programs, rig):
    with board(programs, rig) as (port, one):
        one.is_stopped = lambda: True
        path = play(port, one, wave(one, 100))
        assert np.ptp(path[20:], axis=0).max() == 0.0
        assert "emergency stop" in answer(port, "status")
        for _ in range(60):  # the computer is gone
            port.run()
        assert answer(port, "loop1") == "refused: the emergency stop is on: reset releases it"
        one.is_stopped = lambda: False  # it is back, and reset
        path = play(port, one, np.repeat(one.positions[None] + 0.1, 300, axis=0))
        assert one.recoveries == 1
        assert np.abs(path[-1] - one.goals).max() < 1e-4


@thorough
@needs_compiler
def test_after_a_reset_the_goals_are_come_to_slowly(programs, rig):
    with board(programs, rig) as (port, one):
        play(port, one, wave(one, 100))
        one.is_stopped = lambda: True
        play(port, one, np.repeat(one.goals[None], 60, axis=0))
        one.is_stopped = lambda: False
        held = one.positions.copy()
        path = play(port, one, np.repeat(held[None] + 0.6, 300, axis=0))
        assert np.abs(path[-1] - held - 0.6).max() < 1e-4
        assert 0.005 < np.abs(np.diff(path, axis=0)).max() < 0.03  # 4.7 rad/s would be 0.047
        assert (one.report.faults, one.recoveries) == (0, 0)


@thorough
@needs_compiler
def test_commands_and_stops_at_the_board(programs, rig):
    with board(programs, rig) as (port, one):
        play(port, one, wave(one, 50))
        assert answer(port, "loop1", one) == "refused: a computer gives the goals: goals 0"
        assert answer(port, "goals 99", one) == "refused: no time from 0 to 60 s"
        assert answer(port, "estop", one) == "ok"
        with pytest.raises(RigError, match="the rig has stopped: the emergency stop of the board"):
            play(port, one, wave(one, 3))
        assert one.close() == []
        with pytest.raises(RigError, match=r"takes no goals .*: refused: the emergency stop is on: reset"):
            BoardRig(load_rig(rig), port)


@thorough
@needs_compiler
def test_a_dead_board_stops_the_rig(programs, rig):
    with board(programs, rig) as (port, one):
        play(port, one, wave(one, 50))
        port.dead = True
        with pytest.raises(RigError, match="does not answer"):
            play(port, one, wave(one, 150))
        assert one.close() == ["joint0", "joint1", "joint2"]
        with pytest.raises(RigError, match=r"takes no goals .*: it does not answer"):
            BoardRig(load_rig(rig), port)


@thorough
@needs_compiler
def test_a_sketch_of_another_rig_is_refused(programs, rig):
    with arduino_boards.board_port(programs[1]["SerialGoals"]) as port:
        config = load_rig(rig)
        moved = msgspec.structs.replace(config.joints[1], zero=1999)
        for other in (config.joints[:2], (config.joints[0], moved, config.joints[2])):
            with pytest.raises(RigError, match=r"this rig \(\d joints, \w+\): ok 3 joints, .*write its") as error:
                BoardRig(msgspec.structs.replace(config, joints=other), port)
            assert "\n" not in str(error.value)
        BoardRig(config, port)


@thorough
@needs_compiler
def test_servos_that_are_silent_or_in_alarm_are_named(programs, rig):
    with board(programs, rig, "Dynamixel") as (port, one):
        port.harm(4, "a")
        port.harm(1, "s")
        play(port, one, wave(one, 100))
        counts = one.report.by_joint
        assert counts["joint0"]["missed"] > 90
        assert counts["joint1"]["missed"] < 10
        assert counts["joint2"]["alert"] > 80
        assert one.states.conditions.tolist() == [CONDITIONS.index("does not answer"), 0, 0]
        assert [incident.source for incident in one.incidents] == ["joint2 (id 4)"]
        with pytest.raises(RigError, match=r"gets no answer from joint0 \(id 1\)"):
            play(port, one, wave(one, 100))


@thorough
@needs_compiler
def test_torque_is_taken_off_at_the_end_and_on_where_the_joints_are(programs, rig):
    with board(programs, rig, "Dynamixel") as (port, one):
        play(port, one, wave(one, 77))
        last = one.positions.copy()
        assert one.close() == []
        assert port.said[-4:] == ["off 1", "off 2", "off 7", "off 4"]
        assert answer(port, "loop1") == "refused: torque is off: on"
        again = BoardRig(load_rig(rig), port)
        assert np.abs(again.positions - last).max() < 0.01
        path = play(port, again, wave(again, 100))
        assert np.abs(path[-1] - again.goals).max() < 0.02
    with board(programs, rig, "Dynamixel", on_exit="hold") as (port, one):
        assert one.close() == []
        port.run()
        assert "off 1" not in port.said[4:]


@thorough
@needs_compiler
def test_the_guard_brakes_and_stops_a_board(programs, rig):
    with board(programs, rig) as (port, one):
        figure, targets = programs[0], Targets(3)
        guard = RigGuard(one, safety_envelope(figure.limits, 0.01), targets, 0.01, port.now())
        one.is_stopped = lambda: guard.stop.stopped
        goals, pressed = wave(one, 400, 0.3), 150
        for tick, row in enumerate(goals):
            targets.set(port.now(), False, False, 0, 0)
            targets.joints[:] = row if tick < pressed else goals[pressed]
            guard.receive(port.now())
            guard.tick(port.now())
            if tick == pressed:
                guard.press(1)
            port.run()
            assert guard.failure == ""
        assert guard.stop.phase == "latched"
        assert "emergency stop" in answer(port, "status")


@thorough
@needs_compiler
def test_play_drives_the_board_of_a_rig_file(programs, rig, tmp_path):
    figure, made = programs
    save_library(figure.library, library := tmp_path / "made.safetensors")

    def played():
        with arduino_boards.running_board(made["Dynamixel"]) as (port, said):
            (file := tmp_path / "board.toml").write_text(f'board = "{port}"\n{rig.read_text()}')
            words = ["play", "loop1", "--library", library, "--rig", file, "--headless", "--seconds", "1", "--json"]
            command = [sys.executable, "-m", "motiondeck", *map(str, words)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        told = json.loads(done.stdout)["rig"]
        assert (told["recoveries"], told["incidents"]) == (0, [])
        assert told["tracking_rmse_rad"] < 0.1
        goals = np.array([line.split()[1:] for line in said if line.startswith("goals")], float)
        assert np.ptp(goals, axis=0).max() > 100
        assert said[-4:] == ["off 1", "off 2", "off 7", "off 4"]

    tried(played)


@thorough
@needs_compiler
def test_rig_stop_takes_the_torque_off_at_the_board(programs, rig, tmp_path):
    def stopped():
        with arduino_boards.running_board(programs[1]["Dynamixel"]) as (port, said):
            (file := tmp_path / "board.toml").write_text(f'board = "{port}"\n{rig.read_text()}')
            done = motiondeck("rig", "stop", file)
        assert (done.returncode, done.stdout) == (0, "torque off: 4 of 4 servos\n")
        assert said[-4:] == ["off 1", "off 2", "off 7", "off 4"]

    tried(stopped)
    (gone := tmp_path / "gone.toml").write_text(f'board = "{tmp_path}/nothing"\n{rig.read_text()}')
    assert motiondeck("rig", "stop", gone).returncode == 1


def tell(port, rig, goals):
    """Where the joints are, as the board answers goals by."""
    port.send(line_of(GOALS, goals, 0))
    port.run()
    port.run()
    answers = [line for line in port.receive().split(b"\n") if line.startswith(ANSWER)]
    return read_line(answers[-1].rstrip(), len(goals))[0]


def answer(port, command, rig=None):
    """The board's reply to a command; a rig goes on meanwhile."""
    port.send(f"{command}\n".encode())
    if rig is not None:
        rig.write(rig.goals)
    port.run()
    lines = [line.decode() for line in port.receive().split(b"\n")]
    return next(line for line in lines if line and not line.startswith(("goals", "<")))
