"""How many Python functions a tick calls: a loop that sleeps between its ticks finds each of them cold."""

import sys

import pytest

from baked_jog import baked_jog
from benchmarks.simulated_time import VirtualClock
from controller.deck.deck import Deck
from controller.loop.loop import run
from controller.loop.output_channel import Channel
from controller.loop.safety.safety_envelope import SafetyEnvelope
from motiondeck_base.shipped import find_robot
from shipped_libraries import shipped
from sim.physics.playback import PhysicsPlayback
from sim.robots.robot import load_robot

RATE = 200.0


class Unmeasured:
    """An output whose joints nobody measures, so that there is no approach: the motion begins at once."""

    name = "physics"

    def __init__(self, stage):
        self.write, self.report, self.close = stage.write, stage.report, stage.close

    def measured(self):
        return None


@pytest.mark.parametrize(
    ("load", "motion", "least", "most"),
    [(shipped, "walk", 50, 125), (baked_jog, "jog", 50, 100)],
    ids=["live", "baked"],
)
def test_a_tick_calls_few_functions(load, motion, least, most):
    library = load()
    robot = load_robot(find_robot("servo20"), library.skeleton)
    called = ticks = 0

    def count(frame, event, argument):
        nonlocal called
        called += event == "call"

    def publish(state):
        nonlocal ticks
        ticks += 1
        sys.setprofile(count if 100 <= ticks < 200 else None)

    try:
        run(
            Deck(library, robot.retarget, motion),
            [Channel(Unmeasured(PhysicsPlayback(robot, 1.0 / RATE)))],
            VirtualClock(RATE),
            SafetyEnvelope(robot.limits, 1.0 / RATE),
            seconds=1.1,
            publish=publish,
            publish_every=1,
        )
    finally:
        sys.setprofile(None)
    assert least < called / 100 <= most
