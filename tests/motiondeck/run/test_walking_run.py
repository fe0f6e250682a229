"""A run of a robot that walks: what its report says, and what is refused."""

import pytest

from benchmarks.simulated_time import VirtualClock
from command_line import motiondeck
from controller.deck.deck import Deck
from motiondeck.run.assembly import open_session
from motiondeck.run.report import summary
from motiondeck.run.robots.robot_on_deck import open_robots
from motiondeck.run.session import Host, Played
from motiondeck.run.spec.run_spec import RunSpec
from shipped_libraries import shipped

RATE = 200.0


def report_of(motion, seconds, **setup):
    library = shipped()
    spec = RunSpec(robot="servo20", root="free", rate=RATE, seconds=seconds, **setup)
    played = Played(
        library, lambda opening: open_robots(opening, spec, library), lambda retarget: Deck(library, retarget, motion)
    )
    with open_session(spec, played, Host(clock=VirtualClock(RATE))) as session:
        return session.run()


@pytest.mark.thorough
def test_a_fall_is_told_on_the_clock_of_the_run():
    report = report_of("jog", 1.0)
    fell = report["outputs"][0]["fell_s"]
    assert 0.0 <= fell <= 1.0  # the approach before the motion takes more than a second
    assert f"the robot fell {f'after {fell:.1f} s' if fell >= 0.05 else 'at once'}" in summary(report)


@pytest.mark.thorough
def test_the_report_tells_how_far_it_walked():
    report = report_of("walk", 2.5, walk=True)
    travel = report["outputs"][0]["travel"]
    assert travel["asked_m"] > travel["walked_m"] > 0.02
    assert f"walked {travel['walked_m']:.1f} m; the motion went {travel['asked_m']:.1f} m" in summary(report)


@pytest.mark.thorough
def test_servo20_keeps_on_its_feet_as_play_plays_a_walk():
    # Without its ankles' share (`ankle = 0`) it falls after 6 s.
    output = report_of("walk", 15.0, walk=True)["outputs"][0]
    assert (output["fell_s"], output["near_falls_s"], output["own_steps"]) == (None, [], 0)
    assert 0.6 < output["travel"]["walked_m"] / output["travel"]["asked_m"] < 1.1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--root", "gantry"), "needs a free root, not gantry: give --root free"),
        (("--root", "free", "--balance"), "leave --balance"),
        (("--root", "free", "--lock-to", "body"), "the body is 1.2 s behind"),
        (("--root", "free", "--kinematic"), "leave --kinematic"),
    ],
)
def test_what_does_not_go_with_walking_is_refused_in_one_line(options, said):
    result = motiondeck("play", "walk", "--robot", "servo20", "--walk", "--headless", "--seconds", "1", *options)
    assert result.returncode == 1
    assert said in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
