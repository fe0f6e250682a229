"""The program as its users run it: its output and its exit code; what plays, in a process of its own."""

import json
import os
import pty
import re
import shlex
import shutil
import socket
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

import pytest
import typer

import controller
import synthetic
from command_line import motiondeck
from controller.library.motion_library import save_library
from controller.wire.local_transport import command_folder
from idle_programs import idle_programs
from motiondeck.cli.main import command_line

pytestmark = pytest.mark.smoke


def process(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "motiondeck.cli.main", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=110,
        stdin=subprocess.DEVNULL,
        check=False,
    )


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    path = tmp_path_factory.mktemp("library") / "small.safetensors"
    save_library(synthetic.small_library(), path)
    return path


@pytest.fixture(scope="module")
def report(library):
    """A short headless run with switches."""
    run = process(
        *("play", "--library", library, "--headless", "--command-port", "0", "--seconds", "1.8"),
        *("--script", "march 0.6, wave 0.6, march", "--json"),
    )
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def test_a_headless_run_reports_in_one_json_object(report):
    assert {"rate_hz", "ticks", "overruns", "lateness_us", "work_us", "switches", "outputs"} <= report.keys()
    for durations in (report["lateness_us"], report["work_us"]):
        assert {"p50", "p99", "p999", "max"} <= durations.keys()
    assert report["outputs"][0]["faults"] == 0


def test_each_switch_of_the_script_is_on_record(report):
    assert [switch["to"] for switch in report["switches"]] == ["wave", "march"]
    for switch, at in zip(report["switches"], (0.6, 1.2), strict=True):
        assert switch["commanded_s"] == pytest.approx(at, abs=0.02)
        assert 0.0 < switch["first_change_s"] - switch["commanded_s"] < 0.02


def test_without_json_a_few_words_are_said(library):
    run = motiondeck(
        "play", "--library", library, "--headless", "--rate", "100", "--command-port", "0", "--seconds", "0.3"
    )
    assert run.returncode == 0
    assert "played to the end" in run.stdout
    assert "ticks at" in run.stdout


def test_an_emulated_rig_is_streamed_to_and_answers():
    run = process(
        # The first pose of a walk is near to where the servos are at first, so that they soon approach it.
        *("play", "walk", "--headless", "--command-port", "0", "--seconds", "0.5"),
        *("--rig", "emulated", "--robot", "servo20", "--rate", "100", "--json"),
    )
    assert run.returncode == 0, run.stderr
    rig = json.loads(run.stdout)["rig"]
    assert (rig["joints"], rig["hz"]) == (20, 100.0)
    assert {"write_us", "read_us", "faults"} <= rig.keys()
    assert 0.0 < rig["tracking_rmse_rad"] < 0.3


def test_a_running_deck_takes_commands_and_stops(library, tmp_path):
    port = "47913"
    deck = subprocess.Popen(
        [
            *(sys.executable, "-m", "motiondeck.cli.main", "play", "--library", str(library)),
            *("--headless", "--rate", "100", "--command-port", port, "--json"),
        ],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        deadline = time.monotonic() + 90.0
        while motiondeck("send", "status", "--command-port", port).returncode:
            assert time.monotonic() < deadline, "the deck did not come up"
            time.sleep(0.05)
        settled = motiondeck("send", "switch", "wave", "--wait", "--command-port", port)
        assert settled.returncode == 0
        assert "settled on wave" in settled.stdout
        refused = motiondeck("send", "switch", "wafe", "--command-port", port)
        assert refused.returncode == 1
        assert "Did you mean wave" in refused.stdout
        said, busy = set(), socket.create_server(("127.0.0.1", 0))
        for options in (["--headless"], ["--port", "0"], ["--port", busy.getsockname()[1]]):
            taken = motiondeck("play", "--library", library, *options, "--command-port", port)
            assert taken.returncode == 1
            said.add(taken.stderr)
        busy.close()
        (words,) = said  # one message, whatever is taken first
        assert f"'motiondeck send --command-port {port} stop'" in words
        assert words.strip().endswith("--port 0 --command-port 0")
        state = json.loads(motiondeck("send", "status", "--json", "--command-port", port).stdout)
        assert state["motion"] == "wave"
        with idle_programs(command_folder() / port, 1000), idle_programs(command_folder() / f"{port}.stop", 100):
            full = motiondeck("send", "status", "--command-port", port)
            assert (full.returncode, "the deck is full" in full.stderr) == (1, True)
            stopped = motiondeck("send", "estop", "--command-port", port)  # which waits 0.5 s for the reply
            assert (stopped.returncode, stopped.stdout) == (0, "accepted\n")
        while (state := motiondeck("send", "status", "--json", "--command-port", port)).returncode:
            assert time.monotonic() < deadline, "the deck stays full"
        assert json.loads(state.stdout)["mode"] == "emergency stop"
        assert motiondeck("send", "stop", "--command-port", port).returncode == 0
        out, _ = deck.communicate(timeout=60)
        assert [switch["to"] for switch in json.loads(out)["switches"]] == ["wave"]
        assert deck.returncode == 0
    finally:
        deck.kill()
        deck.wait()
    gone = motiondeck("send", "status", "--command-port", port)
    assert gone.returncode == 1
    assert "no deck is running" in gone.stderr


def test_a_library_is_shown(library):
    shown = motiondeck("library", "show", library)
    assert shown.returncode == 0
    assert "march" in shown.stdout
    assert [m["name"] for m in json.loads(motiondeck("library", "show", library, "--json").stdout)["motions"]] == [
        "march",
        "wave",
        "bow",
    ]


def test_the_shipped_library_is_found_by_name():
    said = json.loads(motiondeck("library", "show", "thesis15", "--json").stdout)
    assert len(said["motions"]) == 15
    assert "NSF EIA-0196217" in said["acknowledgement"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("play", "wlak", "--headless"), "thesis15: unknown motion 'wlak'. Did you mean walk"),
        (("play", "--library", "thesis16", "--headless"), "unknown library 'thesis16'. Did you mean thesis15"),
        (("play", "--library", "none.safetensors", "--headless"), "none.safetensors: there is no such file"),
        (("play", "--robot", "servo2", "--headless"), "unknown robot 'servo2'. Did you mean servo20"),
        (("play", "--rig", "emulated", "--headless"), "--rig emulated --robot servo20"),
        (("play", "--script", "walk 1, jgo", "--headless"), "part 2: unknown motion 'jgo'"),
        (("play", "walk", "--script", "jog", "--headless"), "not both"),
        (("play", "--seconds", "-1", "--headless"), "--seconds -1"),
        (("play", "--rate", "0", "--headless", "--command-port", "0"), "cannot run at 0"),
        (("play", "--rate", "nan", "--headless", "--command-port", "0"), "rate is nan"),
        (("play", "--video", "walk.avi", "--seconds", "1"), "walk.avi"),
        (("library", "show", "pyproject.toml"), "pyproject.toml: not a library file, which ends in .safetensors"),
        (("learn", "none.toml", "--data", ".", "--out", "x.safetensors"), "none.toml: cannot be read"),
        (
            ("clip", "show", "walk.bvh", "--unit", "cm"),
            "--unit cm: give a unit's length in m (0.01 for cm)",
        ),
        (("send", "tempo", "fast"), "TEMPO must be a number from -3 to 3"),
        (("send", "tempo", "-4"), "TEMPO must be a number from -3 to 3, not -4"),
        (("send", "tempo -1 soon"), "tempo: SECONDS must be a number from 0 to 60"),
    ],
)
def test_a_mistake_ends_in_one_clear_line(arguments, says):
    run = motiondeck(*arguments)
    assert run.returncode == 1
    assert says in run.stderr
    assert run.stderr.startswith("motiondeck: ")
    assert len(run.stderr.strip().splitlines()) == 1
    assert run.stdout == ""


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("paly",), "No such command 'paly'"),
        (("play", "--root", "string"), "'string' is not one of 'gantry', 'fixed', 'free'"),
        (("preflight", "--root", "string"), "'string' is not one of"),
        (("retarget", "walk.bvh", "--robot", "servo20", "--out", ".", "--format", "fbx"), "'fbx' is not one of"),
        (("robot", "check", "servo20", ".", "--solver", "magic"), "'magic' is not one of 'angles', 'ik'"),
        (("play", "--seconds", "x"), "'--seconds'"),
        (("play", "--rate", "fast"), "'fast' is not a number"),
        (("play", "--port", "x"), "'x' is not a whole number"),
        (("rig", "doctor", "servo20", "--fast"), "--fast"),
        (("send", "status", "--jsn"), "there is no option --jsn"),
    ],
)
def test_a_word_that_no_command_knows_ends_in_one_line_that_names_the_help(arguments, says):
    run = motiondeck(*arguments)
    assert run.returncode == 2
    assert says in run.stderr
    assert run.stderr.startswith("motiondeck: ")
    assert run.stderr.endswith(" --help` explains.\n")
    assert len(run.stderr.splitlines()) == 1


def every_command(group, words=()):
    for name, command in getattr(group, "commands", {}).items():
        yield from every_command(command, (*words, name))
    if not hasattr(group, "commands"):
        yield words, {parameter.name for parameter in group.params if parameter.required}


REQUIRING = [words for words, required in every_command(typer.main.get_command(command_line())) if required]


def test_a_command_without_its_arguments_shows_an_example_that_has_them_all():
    assert len(REQUIRING) > 30
    for words in REQUIRING:
        said = motiondeck(*words).stderr
        example = re.search(
            rf" Example: motiondeck ({' '.join(words)} .*)\. `motiondeck {' '.join(words)} --help`", said
        )
        assert "Missing" in said
        assert example, said
        assert len(said.splitlines()) == 1
        again = motiondeck(*shlex.split(example[1]), "--no-such-option")
        assert "o such option" in again.stderr or "no option --no-such-option" in again.stderr


def test_without_words_it_says_what_to_try_and_h_is_help():
    alone = motiondeck().stdout
    assert "Three things to try" in alone
    assert "motiondeck learn walk.bvh" in alone
    for words in (("-h",), ("play", "-h"), ("rig", "scan", "-h")):
        assert motiondeck(*words).stdout == motiondeck(*words[:-1], "--help").stdout != ""


def test_help_is_wrapped_where_the_terminal_ends(monkeypatch):
    for columns in (80, 132):
        monkeypatch.setenv("COLUMNS", str(columns))
        sentence, _, _ = motiondeck("play", "--help").stdout.partition("Examples")
        assert max(map(len, sentence.splitlines())) <= columns
        # Words move up as far as they fit: no line ends long before the terminal does, but the last of a paragraph.
        first, second = sentence.split("Opens a page")[1].splitlines()[:2]
        assert len(" Opens a page" + first.rstrip()) + len(second.split()[0]) + 1 > columns - 2


def test_help_names_what_is_given_and_no_types(monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    for words in (("send",), ("rig", "scan"), ("conduct",), ("robot", "tune-walk")):
        assert re.findall(r"<(?:str|path|int|float).*?>", motiondeck(*words, "--help").stdout) == []


def test_the_help_of_send_lists_the_commands(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    words = " ".join(re.sub("[│*]", " ", motiondeck("send", "--help").stdout).split())
    assert "One of: switch, queue, blend, tempo, input," in words
    assert "`motiondeck send help` explains them" in words


def test_examples_fit_the_terminal_and_can_be_pasted(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    for command in ("play", "send", "evaluate", "learn"):
        _, _, examples = motiondeck(command, "--help").stdout.partition("Examples")
        lines = [line.strip() for line in examples.partition("╭")[0].splitlines() if line.strip()]
        pasted = "\n".join(lines).replace(" \\\n", " ").splitlines()
        assert all(line.startswith(f"motiondeck {command}") for line in pasted), lines
    assert (
        "\n  motiondeck play                a humanoid, with a button for each motion"
        in motiondeck().stdout.replace("\n ", "\n")
    )


def test_the_version_is_that_of_the_package():
    assert motiondeck("--version").stdout == f"motiondeck {version('motiondeck')}\n"


def test_libraries_are_listed_with_those_of_the_folder(library, tmp_path, monkeypatch):
    shutil.copy(library, tmp_path / "mine.safetensors")
    (tmp_path / "broken.safetensors").write_text("no library")
    monkeypatch.chdir(tmp_path)
    told = {row["library"]: row for row in json.loads(motiondeck("library", "list", "--json").stdout)["libraries"]}
    assert len(told["thesis15"]["motions"]) == 15
    assert told["mine.safetensors"]["motions"] == ["march", "wave", "bow"]
    assert "broken.safetensors" in told["broken.safetensors"]["reason"]
    table = motiondeck("library", "list").stdout
    assert all(name in table for name in told)


def test_a_mistake_in_a_process_ends_in_the_same_line():
    run = process("play", "wlak", "--headless")
    assert (run.returncode, run.stdout) == (1, "")
    assert run.stderr.startswith("motiondeck: thesis15: unknown motion 'wlak'. Did you mean walk")
    assert len(run.stderr.strip().splitlines()) == 1


def test_help_lists_the_commands_in_panels(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    shown = motiondeck("--help").stdout
    assert re.findall(r"^╭─ (.*?) ─", shown, flags=re.M) == [
        "Options",
        "Play",
        "Learn",
        "Robot",
        "Servo rig",
        "Export",
        "Show",
    ]
    assert re.findall(r"^│ {10,12}\w.*", shown, flags=re.M) == []  # each command has one line


def test_debug_shows_where_a_mistake_was_noticed():
    run = process("--debug", "play", "wlak", "--headless")
    assert run.returncode != 0
    assert "Traceback" in run.stderr


def test_a_page_port_in_use_is_named(library):
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        run = process("play", "--library", library, "--port", port, "--command-port", "0", "--seconds", "1")
    assert run.returncode == 1
    assert f"port {port} for the page cannot be used" in run.stderr


def test_a_recipe_that_cannot_be_read_leaves_nothing(tmp_path):
    recipe = tmp_path / "r.toml"
    recipe.write_text('name = "x"\nnetwrok = 3\n')
    run = motiondeck("learn", recipe, "--data", tmp_path, "--out", tmp_path / "x.safetensors")
    assert run.returncode == 1
    assert "unknown key 'netwrok'" in run.stderr
    assert list(tmp_path.iterdir()) == [recipe]


def test_words_for_a_terminal_that_is_closed_end_without_a_traceback():
    ours, theirs = pty.openpty()
    code = (
        "import sys; from motiondeck.cli.main import main; sys.stdin.readline(); sys.argv[1:] = ['--version']; main()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=theirs, stderr=subprocess.PIPE, text=True
    ) as run:
        os.close(theirs)
        os.close(ours)
        _, said = run.communicate("\n", timeout=110)
    assert (run.returncode, said) == (129, "")


@pytest.mark.thorough
def test_a_terminal_without_a_letter_shows_a_question_mark(library, tmp_path):
    shutil.copy(library, tmp_path / "größe.safetensors")
    done = subprocess.run(
        [sys.executable, "-m", "motiondeck.cli.main", "library", "list"],
        env=os.environ | {"PYTHONIOENCODING": "ascii", "PYTHONPATH": str(Path(controller.__file__).parent.parent)},
        cwd=tmp_path,
        capture_output=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"gr??e" in done.stdout
