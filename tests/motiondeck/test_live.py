"""A live deck in its own process: commands, events, and its end, whoever brings it about."""

import os
import select
import signal
import subprocess
import sys
import threading
import time
from contextlib import closing
from fractions import Fraction

import numpy as np
import pytest

import motiondeck
import synthetic
from controller.wire.command_socket import CommandClient
from controller.wire.messages.commands import EmergencyStop, GetStatus
from controller.wire.messages.replies import Accepted
from controller.wire.run_recording import load_recording
from motiondeck import MotiondeckError
from motiondeck.libraries import Library
from waiting import PATIENCE, quick, runs, until

PROGRAM = """
import motiondeck, sys
deck = motiondeck.play(sys.argv[1], physics=False, rate=100.0)
print(deck._process.pid, flush=True)
sys.stdin.read()
"""

FORKING_PROGRAM = """
import motiondeck, os, sys, time
deck = motiondeck.play(sys.argv[1], physics=False, rate=100.0)
print(deck._process.pid, flush=True)
child = os.fork()
if child == 0:
    time.sleep(60.0)
    os._exit(0)
print(child, flush=True)
time.sleep(60.0)
"""


@pytest.fixture(scope="module", autouse=True)
def _patient():
    """A deck is a process that may wait for a core."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("motiondeck.live._ANSWERS_WITHIN", PATIENCE)
        yield


@pytest.fixture(scope="module")
def library():
    return Library(synthetic.small_phase_library())


@pytest.mark.parametrize("number", ["rate", "seconds"])
def test_a_length_of_time_that_is_no_number_is_refused_before_anything_starts(library, number):
    with pytest.raises(MotiondeckError, match=f"{number} is nan"):
        motiondeck.play(library, "march", physics=False, **{number: float("nan")})


def test_ten_lines_play_switch_on_a_condition_and_end(library, tmp_path):
    with motiondeck.play(library, "march", physics=False, rate=100.0, record=tmp_path / "show.rec") as deck:
        assert deck.motions == ("march", "wave", "bow")
        assert deck.status().motion == "march"
        if deck.status().tempo > 0.5:
            settled = deck.switch("wave").wait()
        assert 0.0 < settled < 5.0
        assert (deck.status().motion, deck.status().switching, deck.running) == ("wave", False, True)
    assert not deck.running
    assert deck.report is not None
    assert (deck.report["reason"], deck.report["switches"][0]["to"]) == ("stopped on command", "wave")
    assert load_recording(tmp_path / "show.rec").complete
    with pytest.raises(MotiondeckError, match="the deck has ended: stopped on command"):
        deck.switch("march")
    deck.close()


def test_the_threads_of_a_program_share_a_connection(library):
    """70 of them would be more than a deck has places for programs, and 70 commands at once more than it takes."""
    with motiondeck.play(library, "march", physics=False, rate=100.0) as deck:
        told, waited, together, over = [], [], threading.Barrier(71), threading.Event()

        def ask():
            together.wait()
            told.append(deck.status().motion)
            over.wait()

        def switch():
            together.wait()
            waited.append(deck.switch("wave").wait())

        threads = [threading.Thread(target=act) for act in [ask] * 70 + [switch]]
        for thread in threads:
            thread.start()
        with closing(CommandClient(deck.command_port)) as another:
            threads.pop().join()
            while len(told) < 70:
                time.sleep(0.01)
            assert another.request(GetStatus()).motion == "wave"
            assert isinstance(another.request(EmergencyStop()), Accepted)
        over.set()
        for thread in threads:
            thread.join()
        assert 0.0 < waited[0] < 5.0


def test_a_deck_that_is_held_up_says_within_half_a_second_that_it_takes_no_stop(library, hasty):
    with motiondeck.play(library, "march", physics=False, rate=100.0) as deck:

        def stop():
            with pytest.raises(MotiondeckError, match="the emergency stop is not acknowledged"):
                deck.emergency_stop()

        asking = [threading.Thread(target=deck.status) for _ in range(40)]  # more than may wait at once
        os.kill(deck._process.pid, signal.SIGSTOP)
        try:
            for thread in asking:
                thread.start()
            quick(stop, 1.2)
        finally:
            os.kill(deck._process.pid, signal.SIGCONT)
        for thread in asking:
            thread.join()
        assert deck.status().mode == "emergency stop"  # it is taken as soon as the deck goes on


@pytest.fixture(scope="module")
def marching(library):
    """A deck of several tests; its rate and length are numbers of numpy."""
    with motiondeck.play(library, "march", physics=False, rate=np.int64(100), seconds=np.float64(100.0)) as deck:
        yield deck


def test_an_argument_of_another_type_is_named(library, marching):
    with pytest.raises(MotiondeckError, match="rate: expected float, got str"):
        motiondeck.play(library, rate="fast")
    with pytest.raises(MotiondeckError, match="to: expected str, got int"):
        marching.switch(3)
    with pytest.raises(MotiondeckError, match="to: expected str, got bytes"):
        marching.switch(b"march")
    with pytest.raises(MotiondeckError, match="first: expected str, got int"):
        marching.blend(3, "wave", 0.5)
    with pytest.raises(MotiondeckError, match="factor: expected float, got complex"):
        marching.set_tempo(1j)
    with pytest.raises(MotiondeckError, match=r"factor: expected float, got numpy\.ndarray"):
        marching.set_tempo(np.ones(2))
    assert marching.status().motion == "march"


@pytest.mark.parametrize("number", [np.float64(0.5), np.float32(0.5), np.int64(1), Fraction(1, 2)])
def test_numbers_of_any_type_are_taken(marching, number):
    marching.tempo = 1.0
    marching.switch("march").wait()
    marching.tempo = number
    marching.jump(np.float32(0.25))
    marching.blend("march", "wave", np.float64(0.5))


def test_any_thread_may_wait_for_a_switch_as_often_as_it_likes(marching):
    marching.tempo = 1.0

    def asked():
        """How often another thread is answered meanwhile."""
        marching.switch("march").wait()
        commanded, waited, count = marching.switch("wave"), [], 0
        waiting = [threading.Thread(target=lambda: waited.append(commanded.wait(PATIENCE))) for _ in range(2)]
        for thread in waiting:
            thread.start()
        while any(thread.is_alive() for thread in waiting):
            marching.status()  # its answers come to the same socket
            count += 1
        assert waited == [commanded.wait(0.0)] * 2
        return count

    until(lambda: asked() > 10, "an attempt in which nobody keeps the socket to himself while he waits")
    marching.pause()  # so that the first one has not settled when the second one comes
    overtaken, last = marching.switch("march"), marching.switch("wave")
    marching.resume()
    last.wait()
    for _ in range(2):
        with pytest.raises(MotiondeckError, match="overtaken"):
            overtaken.wait(1.0)


def test_a_forked_process_cannot_command_the_deck_and_leaves_it_alone(library):
    with motiondeck.play(library, "march", physics=False, rate=100.0) as deck:
        said, saying = os.pipe()
        wave = deck.switch("wave")
        child = os.fork()
        if child == 0:
            refused = (deck.status, deck.wait, wave.wait, lambda: deck.running, lambda: next(deck.events()))
            for call in (*refused, deck.close):
                try:
                    call()
                    os.write(saying, b"done\n")
                except MotiondeckError as error:
                    os.write(saying, f"{error}\n".encode())
            os._exit(0)
        os.close(saying)
        lines = []
        with os.fdopen(said) as reading:
            if select.select([said], [], [], 20.0)[0]:
                lines = reading.read().splitlines()
            else:
                os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        belongs = "this deck belongs to the process that started it"
        assert [line.split(":")[0] for line in lines] == [*[belongs] * 5, "done"]
        wave.wait()
        assert deck.status().motion == "wave"


def test_commands_change_the_status_and_appear_as_events(library):
    with motiondeck.play(library, "march", physics=False, rate=100.0) as deck:
        with pytest.raises(MotiondeckError, match=r"unknown motion 'mrach'\. Did you mean march"):
            deck.queue("mrach")
        with pytest.raises(MotiondeckError, match="nothing can be pushed here"):  # its physics are off
            deck.push("left", 0.1)
        with pytest.raises(MotiondeckError, match="side: 'up' is none of front, back, left, right"):
            deck.push("up")
        with pytest.raises(AttributeError, match="tmpo"):
            deck.tmpo = 2.0
        with pytest.raises(MotiondeckError, match=r"from -3 to 3, not 9"):
            deck.set_tempo(9.0)
        deck.tempo = -0.5
        while deck.tempo > -0.5:
            pass
        deck.jump(0.25)
        assert 0.0 <= deck.phase <= 1.0
        deck.tempo = 1.0
        deck.pause()
        first, second = deck.switch("wave"), deck.switch("march")
        deck.resume()
        with pytest.raises(MotiondeckError, match="overtaken"):
            first.wait()
        second.wait()
        with pytest.raises(MotiondeckError, match="bow is a one-shot"):
            deck.blend("march", "bow", 0.5)
        events = deck.events()
        for command, kind in (
            (deck.pause, "paused"),
            (deck.resume, "resumed"),
            (lambda: deck.switch("wave"), "settled"),
            (deck.emergency_stop, "mode"),
        ):
            command()
            while next(events).kind != kind:
                pass
        assert deck.status().mode == "emergency stop"
        with pytest.raises(MotiondeckError, match="the emergency stop is on"):
            deck.switch("march")


def test_it_ends_by_itself_and_events_with_it(library):
    with motiondeck.play(library, "march", physics=False, rate=100.0, seconds=0.5) as deck:
        assert [event.kind for event in deck.events()][-1] == "ended"
        assert deck.wait(30.0)["reason"] == "played to the end"
        assert deck.wait() is deck.report


@pytest.mark.parametrize(
    ("wanted", "says"),
    [
        ({"library": "thesis14"}, "unknown library 'thesis14'. Did you mean thesis15"),
        ({"rig": "emulated"}, "no rig for robot 'mannequin'"),
        ({"rig": "emulated2"}, "unknown rig 'emulated2'. Did you mean emulated?"),
        ({"rig": "lab"}, "unknown rig 'lab'. There are: emulated, pan-tilt, servo20"),
    ],
)
def test_what_cannot_be_played_is_said_in_one_line(wanted, says):
    with pytest.raises(MotiondeckError, match=says):
        motiondeck.play(**wanted)


def test_a_deck_that_breaks_off_is_noticed(library, capfd):
    deck = motiondeck.play(library, "march", physics=False, rate=100.0)
    os.kill(deck._process.pid, signal.SIGKILL)
    deck._process.wait()
    with pytest.raises(MotiondeckError, match="broke off with exit code -9"):
        deck.wait()
    deck.close()


def test_it_ends_with_the_program_that_started_it(library, tmp_path):
    library.save(tmp_path / "small.safetensors")
    command = [sys.executable, "-c", PROGRAM, str(tmp_path / "small.safetensors")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        pid = int(program.stdout.readline())
        program.kill()
    until(lambda: not runs(pid), "the end of the deck without its program")


def test_it_ends_with_the_program_that_started_it_even_if_its_forked_children_live_on(library, tmp_path):
    library.save(tmp_path / "small.safetensors")
    command = [sys.executable, "-c", FORKING_PROGRAM, str(tmp_path / "small.safetensors")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        deck, child = int(program.stdout.readline()), int(program.stdout.readline())
        program.kill()
        try:
            until(lambda: not runs(deck), "the end of the deck without its program")
        finally:
            os.kill(child, signal.SIGKILL)
