"""What a terminal shows while a run goes on, and the words at its end."""

import io
import threading
import time
from dataclasses import dataclass

import pytest

from controller.loop.stop_requests import StopRequest
from controller.loop.stop_state import StopState
from motiondeck.run.report import PERIOD, progress_line, summary, words_of
from waiting import until


class Terminal(io.StringIO):
    def isatty(self):
        return True


@dataclass
class Playing:
    playing: str = "walk"
    settled: bool = True
    time: float = 12.3
    blend: tuple[tuple[str, float], ...] = ()


@pytest.mark.parametrize(
    ("deck", "stop", "seconds", "words"),
    [
        (Playing(), StopRequest(), 20.0, "walk  12 of 20 s"),
        (Playing(), StopRequest(), None, "walk  12 s, Ctrl-C ends it"),
        (
            Playing(blend=(("jog", 0.3), ("waltz", 0.2))),
            StopRequest(),
            20.0,
            "walk with 0.30 of jog and 0.20 of waltz  12 of 20 s",
        ),
        (Playing(settled=False), StopRequest(), 20.0, "walk (on its way)  12 of 20 s"),
        (Playing(time=0.005), StopRequest(), None, "approaching the first pose of walk"),
        (Playing(), StopRequest(state=StopState("latched")), None, "EMERGENCY STOP: walk, Ctrl-C ends it"),
        (Playing(), StopRequest("Ctrl-C was pressed"), None, "Ctrl-C was pressed: the joints come to rest"),
        (Playing(), StopRequest("the rig is lost: gone"), None, "the rig is lost: gone: the joints come to rest"),
    ],
)
def test_the_line_says_motion_time_and_end(deck, stop, seconds, words):
    assert words_of(deck, stop, seconds) == words


def shown(stream, prompt=False, stop=None):
    """What a stream has been told after the line has had the time to be written."""
    before = threading.enumerate()
    with progress_line(Playing(), stop or StopRequest(), None, prompt=prompt, stream=stream):
        lines = [thread for thread in threading.enumerate() if thread not in before]
        if prompt and not stop:
            time.sleep(2.5 * PERIOD)
        else:
            until(stream.getvalue, "the line")
    for line in lines:
        line.join()
    return stream.getvalue()


def test_a_terminal_shows_one_line_and_nothing_is_left_of_it():
    said = shown(Terminal())
    assert "walk  12 s, Ctrl-C ends it" in said
    assert "\n" not in said
    assert said.endswith("\r\x1b[K")


def test_a_pipe_shows_nothing():
    stream = io.StringIO()
    with progress_line(Playing(), StopRequest(), None, prompt=False, stream=stream):
        time.sleep(1.5 * PERIOD)
    assert stream.getvalue() == ""


def test_beside_a_prompt_only_the_end_is_told():
    assert shown(Terminal(), prompt=True) == ""
    said = shown(Terminal(), prompt=True, stop=StopRequest("stopped on command"))
    assert said == "\nstopped on command: the joints come to rest\n"


def test_a_terminal_that_is_gone_ends_nothing():
    stream = Terminal()
    stream.close()
    stream.isatty = lambda: True
    with progress_line(Playing(), StopRequest(), None, prompt=False, stream=stream):
        time.sleep(1.5 * PERIOD)


def test_the_summary_says_when_a_robot_fell_and_what_keeps_it_on_its_feet():
    figures = {"p50": 3.0, "p99": 5.0, "p999": 9.0, "max": 9.0}
    report = {
        **{"reason": "played to the end", "ticks": 400, "rate_hz": 200.0, "overruns": 0, "skipped": 0},
        **{"lateness_us": figures, "work_us": figures, "restarts": 0, "switches": [{"to": "jog", "via": []}]},
        "refused": [],
    }
    report["switches"][0] |= {"commanded_s": 1.0, "settled_s": 1.5}
    parked = {"name": "physics", "parked": False}

    def lines(**output):
        return summary({**report, "outputs": [parked | output]}).splitlines()

    assert "1 switch, settled after 0.50 s" in lines()
    advice = "; with --walk or --balance it can keep on its feet"
    assert f"the robot fell at once{advice}" in lines(fell_s=0.02)
    assert f"the robot fell after 2.0 s{advice}" in lines(fell_s=2.0)
    assert "the robot fell after 2.0 s; it got up 1 time" in lines(fell_s=2.0, near_falls_s=[1.5], got_up=1)


def test_the_summary_says_first_what_happened_then_the_figures():
    figures = {"p50": 3.0, "p99": 5.0, "p999": 9.0, "max": 9.0}
    report = {
        **{"reason": "Ctrl-C was pressed", "ticks": 400, "rate_hz": 200.0, "overruns": 1, "skipped": 0},
        **{"lateness_us": figures, "work_us": figures, "restarts": 0, "outputs": []},
        "switches": [{"to": "jog", "via": ["walk"], "commanded_s": 1.0, "settled_s": 1.5}],
        "refused": [{"at": 1.0, "reason": "no"}],
    }
    lines = summary(report).splitlines()
    assert lines[0] == "ended after 2.0 s: Ctrl-C was pressed"
    assert lines.index("went to jog by way of walk") < lines.index("at 1 s refused: no")
    assert lines[-2].startswith("loop: 400 ticks at 200.00 Hz; 1 began more than a period late")
    assert lines[-1].startswith("tick: 3 us late in the median")
    assert summary({**report, "ticks": 0, "rate_hz": 0.0}).startswith("ended before anything moved: Ctrl-C")
