"""What is lost on the way is said: a recorder that dies, a full disk, no room to share; and nothing is left behind."""

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import synthetic
from command_line import invoked
from controller.library.motion_library import save_library
from controller.wire.run_folder import run_folder, write_shared
from motiondeck.run.beside.child_process import Children, child_process
from motiondeck.run.beside.tick_recorder import TickRecorder
from motiondeck_base.errors import MotiondeckError
from waiting import PATIENCE

HOLD = """
from controller.wire.run_folder import run_folder, write_shared
with run_folder() as folder:
    print(folder, flush=True)
    input()
"""


@pytest.fixture(scope="module")
def play(tmp_path_factory):
    file = tmp_path_factory.mktemp("losses") / "small.safetensors"
    save_library(synthetic.small_library(), file)
    return ("play", "--library", str(file), "--headless", "--kinematic", "--command-port", "0", "--rate", "100")


def test_a_recorder_that_is_killed_is_said_at_once_and_in_the_report(play, tmp_path, monkeypatch, capfd):
    recorded = []

    def record(self, *words, _record=TickRecorder.record, **numbers):
        recorded.append(words)
        if len(recorded) == 5:
            os.kill(self.process.pid, signal.SIGKILL)
            self.process.wait()
        _record(self, *words, **numbers)

    monkeypatch.setattr(TickRecorder, "record", record)
    result = invoked(*play, "--seconds", "0.8", "--record", str(tmp_path / "run.rec"), "--json")
    assert result.exit_code == 1
    report = json.loads(result.stdout)
    assert report["recording"] == {"file": str(tmp_path / "run.rec"), "complete": False}
    assert report["reason"] == "played to the end"
    assert "the recorder has ended; the deck plays on" in result.stderr
    assert len(recorded) > 5


def test_what_comes_of_a_lost_process_is_said_once(capsys):
    children, process = Children(), subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"])
    children.add("the part in the show", process, "no cue reaches this deck")
    process.wait()
    for _ in range(2):
        children.report_dead()
    assert capsys.readouterr().err == "motiondeck: the part in the show has ended; no cue reaches this deck\n"


def test_a_disk_that_is_full_is_said_and_ends_with_exit_code_1(play, capfd):
    result = invoked(*play, "--seconds", "0.8", "--record", "/dev/full")
    assert result.exit_code == 1
    reason = "the recording /dev/full is cut short: cannot be written (No space left on device)"
    assert reason in result.stdout
    assert "/dev/full: cannot be written (No space left on device)" in capfd.readouterr().err


def test_no_room_to_share_is_refused_before_anything_moves(play, tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "motiondeck.cli.main", *play, "--seconds", "0.5", "--record", str(tmp_path / "run.rec")],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000)),
        env=os.environ | {"TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert f"{tmp_path}/motiondeck-" in done.stderr
    assert "no room for" in done.stderr
    assert "Free some, or set TMPDIR" in done.stderr
    assert done.stdout == ""
    assert list(tmp_path.glob("motiondeck-*")) == []


def test_no_room_for_a_model_that_the_page_draws_is_refused():
    with pytest.raises(MotiondeckError, match="/dev: no room for 1 kB that the processes of a run share"):
        write_shared(Path("/dev/full"), "<mujoco/>")


def test_a_folder_of_a_run_that_was_killed_is_removed_by_the_next(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    other = subprocess.Popen([sys.executable, "-c", HOLD], env=os.environ | {"TMPDIR": str(tmp_path)},
                             stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)  # fmt: skip
    assert other.stdout is not None
    theirs = Path(other.stdout.readline().strip())
    (theirs / "state").write_text("?")
    somebody_elses = tmp_path / "motiondeck-report"
    somebody_elses.mkdir()
    with run_folder() as first:
        assert theirs.is_dir()  # its run is alive
        assert first.stat().st_mode & 0o077 == 0
        other.kill()
        other.wait()
        with run_folder():
            assert not theirs.exists()
            assert first.is_dir()
    assert list(tmp_path.iterdir()) == [somebody_elses]


def test_a_folder_that_cannot_be_made_is_a_clear_error(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "nowhere"))
    with pytest.raises(MotiondeckError, match=r"no temporary folder can be made .*set TMPDIR"), run_folder():
        pass


def test_an_interrupt_does_not_reach_a_child_that_is_just_starting():
    with child_process("timeit", "-n", "1", "pass", patience=PATIENCE) as child:
        child.send_signal(signal.SIGINT)
    assert child.returncode == 0


def test_an_interrupt_is_still_heard_where_a_child_cannot_be_started(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/no/python")
    with pytest.raises(FileNotFoundError), child_process("timeit"):
        pass
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
