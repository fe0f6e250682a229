"""Nothing that a tick makes outlives it: the collector is off while the loop runs, so what stayed would pile up."""

import gc
import sys

import numpy as np
import pytest

import synthetic
from benchmarks.simulated_time import VirtualClock
from controller.deck.deck import Deck
from controller.loop.loop import run
from controller.loop.output_channel import Channel
from controller.loop.safety.safety_envelope import SafetyEnvelope
from sim.physics.playback import PhysicsPlayback
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS

RATE = 200.0
LOOK_EVERY = 160


@pytest.fixture(scope="module")
def playing():
    """A deck with its robot, simulated."""
    library = synthetic.small_library()
    robot = load_robot(ROBOTS / "mannequin.toml", library.skeleton)
    return Deck(library, robot.retarget, "march"), robot, PhysicsPlayback(robot, 1.0 / RATE)


def test_a_loop_that_plays_on_holds_no_more_memory_than_before(playing):
    deck, robot, output = playing
    clock = VirtualClock(RATE)
    blocks = np.zeros(8, dtype=np.int64)

    def look(state):
        at, rest = divmod(state.tick, LOOK_EVERY)
        if rest == 0 and at < len(blocks):
            blocks[at] = sys.getallocatedblocks()

    envelope = SafetyEnvelope(robot.limits, clock.period)
    report = run(deck, [Channel(output)], clock, envelope, seconds=len(blocks) * LOOK_EVERY / RATE, publish=look)
    assert report.faults == {"deck": 0, "commands": 0, "stops": 0, "telemetry": 0}
    # Caches fill up in the beginning; what leaks does so between any two looks.
    assert blocks.all()
    assert np.diff(blocks[1:]).min() <= 0


def test_neither_ticks_nor_switches_leave_cycles_to_collect(playing):
    deck, robot, output = playing
    envelope = SafetyEnvelope(robot.limits, 1.0 / RATE)
    envelope.start(np.clip(deck.update(1.0 / RATE)[0], robot.limits.lower, robot.limits.upper))
    gc.collect()
    gc.disable()
    try:
        for tick in range(600):
            if tick % 150 == 0:
                deck.switch(("wave", "march", "bow")[tick // 150 % 3])
            targets, pose = deck.update(1.0 / RATE)
            output.write(envelope(targets), pose)
        assert gc.collect() == 0
    finally:
        gc.enable()
