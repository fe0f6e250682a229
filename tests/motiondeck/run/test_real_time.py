"""A run that drives a real rig asks for real-time scheduling, for the loop alone, and says what it obtained."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hardware.emulator.process import start_emulator
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.shipped import find_rig
from waiting import until


@pytest.mark.parametrize(
    ("options", "asks"),
    [
        ({}, False),
        ({"rig": "emulated"}, False),
        ({"rig": "emulated:servo20"}, False),
        ({"rig": "my-rig.toml"}, True),
        ({"rig": Path("my-rig.toml")}, True),
        ({"rig": "emulated", "follow_rig": "my-rig.toml"}, True),
    ],
)
def test_a_rig_on_real_ports_asks_without_the_option(options, asks):
    assert RunSpec(**options).drives_servos == asks


def is_permitted():
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(60))
    except OSError:
        return False
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return True


def children(pid):
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def test_the_loop_of_a_real_rig_and_its_guard_are_scheduled_first_and_no_process_beside_them_is(tmp_path):
    with start_emulator(find_rig("servo20")) as emulator:
        rig = tmp_path / "servo20.toml"
        lines = find_rig("servo20").read_text().splitlines()
        rig.write_text("\n".join(f'port = "{emulator.port}"' if line.startswith("port =") else line for line in lines))
        said = tmp_path / "said"
        play = ["play", "walk", "--robot", "servo20", "--rig", str(rig), "--record", str(tmp_path / "run.rec")]
        with said.open("w") as errors:
            deck = subprocess.Popen(
                [sys.executable, "-m", "motiondeck", *play, "--headless", "--json", "--seconds", "60"],
                stdout=subprocess.DEVNULL, stderr=errors,
            )  # fmt: skip
        try:
            until(lambda: "(SCHED_FIFO)" in said.read_text() or deck.poll() is not None, "what was obtained")
            first = said.read_text().splitlines()[0]
            assert first.startswith(("granted: real-time", "not permitted: real-time"))
            assert first.startswith("granted") == is_permitted()
            expected = os.SCHED_FIFO if is_permitted() else os.SCHED_OTHER
            until(lambda: os.sched_getscheduler(deck.pid) == expected, "the scheduling")
            guards = [pid for pid in children(deck.pid) if b"guard" in Path(f"/proc/{pid}/cmdline").read_bytes()]
            until(lambda: [os.sched_getscheduler(pid) for pid in guards] == [expected], "that of the guard")
            if is_permitted():
                assert os.sched_getparam(guards[0]).sched_priority > os.sched_getparam(deck.pid).sched_priority
            beside = set(children(deck.pid)) - set(guards)
            assert beside
            assert {os.sched_getscheduler(pid) for pid in [*beside, emulator.pid]} == {os.SCHED_OTHER}
        finally:
            deck.kill()
            deck.wait()
    assert len(said.read_text().splitlines()) <= 3
