"""Recognition from measured joints, and jams, on the emulated rig.

Plays the shipped library in simulated time on the emulated 20-servo rig (or on a simulated robot), switches at random
every 6 s for 10 minutes, and then jams joints of the rig, one at a time, at whatever position they are in. Prints one
JSON object: when the right motion was seen, false alarms, jams found, and what watching costs a tick.
"""

from __future__ import annotations

import argparse
import json
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time
from collections.abc import Callable
from copy import deepcopy

import numpy as np

from benchmarks.simulated_time import EmulatedPort, VirtualClock
from controller.deck.deck import Deck
from controller.learning.recognition.deck_watch import PATIENCE, DeckWatch, joint_motions
from controller.library.motion_library import load_library
from controller.loop.loop import LoopState, run
from controller.loop.output_channel import Channel
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.loop.stop_requests import StopRequest
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import load_rig
from hardware.rig.supervision.rig import Rig
from motiondeck.run.recognition.watches import RecognitionWatch
from motiondeck.run.robots.rig_output import RigOutput, narrowed
from motiondeck_base.shipped import find_library, find_rig, find_robot
from sim.physics.playback import PhysicsPlayback
from sim.robots.robot import load_robot

RATE = 100.0
USED = 0.3  # rad: a motion uses a joint that moves at least so far
SOON = 2.0  # s within which a jam is to be found

PLAYING = StopRequest()  # these runs are not stopped


class SimulatedClock(VirtualClock):
    """A clock whose waiting lets time pass on the emulated bus."""

    port: EmulatedPort | None = None

    def wait(self) -> int:
        """Lets one period pass, here and on the bus."""
        if self.port is not None:
            self.port.elapse(self.period)
        return super().wait()


class Stage:
    """Robot, library and rig; each run gets a new rig, deck and watch."""

    def __init__(self, robot: str, *, rig: bool, tempo: float) -> None:
        self.library = load_library(find_library("thesis15"))
        self.robot = load_robot(find_robot(robot), self.library.skeleton)
        self.config = load_rig(find_rig(robot)) if rig else None
        self.tempo = tempo
        # As when playing: no target is beyond what the servos can reach.
        self.limits = narrowed(self.robot.limits, self.robot, self.config) if self.config else self.robot.limits

    def play(
        self, motion: str, seconds: float, each_tick: Callable[[Deck, RecognitionWatch, EmulatedPort | None], None]
    ) -> RecognitionWatch:
        """Plays from one motion on, watches, and says so tick by tick."""
        clock, robot = SimulatedClock(RATE), self.robot
        if self.config is None:
            channel = Channel(PhysicsPlayback(robot, clock.period))
        else:
            clock.port = EmulatedPort(EmulatedBus(self.config))
            port = clock.port
            rig = Rig(self.config, lambda part: Bus(port, part.baud), beside=False, sleep=port.elapse)
            output = RigOutput(rig, robot.joints, self.config.rate_hz)
            channel = Channel(output, round(RATE / self.config.rate_hz))
        watch = RecognitionWatch(
            self.library,
            deepcopy(robot.retarget),
            robot.joints,
            robot.layout.ball,
            self.limits,
            channel,
            RATE,
            PATIENCE,
            stop=False,
        )
        deck = Deck(self.library, deepcopy(robot.retarget), motion)
        deck.set_tempo(self.tempo)

        def publish(state: LoopState) -> None:
            watch.update(state, deck, PLAYING)
            each_tick(deck, watch, clock.port)

        run(
            deck,
            [channel],
            clock,
            SafetyEnvelope(self.limits, clock.period),
            seconds=seconds,
            publish=publish,
            publish_every=1,
        )
        channel.output.close()
        return watch


def switching(stage: Stage, seconds: float, every: float, seed: int) -> dict[str, object]:
    """Random switches: when the right motion is seen, and false alarms.

    The deck ends a one-shot, and goes by way of others where bodies are too far apart; what it plays
    meanwhile is seen too, and counts from its own first tick.
    """
    rng = np.random.default_rng(seed)
    straight: list[float] = []  # s from the command on, where the deck could go to the motion at once
    roundabout: list[float] = []  # ... where it had to end a motion first, or to go by way of another
    unseen: list[str] = []
    due, under_way = every, None

    def each_tick(deck: Deck, watch: RecognitionWatch, port: EmulatedPort | None) -> None:
        nonlocal due, under_way
        if under_way is not None and watch.watch.seen == under_way.to:
            (roundabout if under_way.after or under_way.via else straight).append(deck.time - under_way.commanded_s)
            under_way = None
        if deck.time >= due:
            if under_way is not None:
                unseen.append(under_way.to)
            under_way = deck.switch(str(rng.choice([name for name in deck.motions if name != deck.motion])))
            due = deck.time + every

    cost = timed(DeckWatch)
    watch = stage.play(next(iter(stage.library.network.motions)), seconds, each_tick)
    said = watch.report()
    return {
        "switches": len(straight) + len(roundabout) + len(unseen),
        "straight": len(straight),
        "seen_after_command_s": spread(straight),
        "seen_after_command_by_way_of_others_s": spread(roundabout),
        "seen_after_its_first_tick_s": spread(list(watch.watch.seen_after)),
        "never_seen_before_the_next_command": unseen,
        "right_share_from_0.7_s_after_settling": said["right_share"],
        "false_alarms": [alarm["text"] for alarm in said["alarms"]],
        "ticks": len(cost),
        "cost_us_median": float(np.median(cost)) * 1e6,
    }


def spread(seconds: list[float]) -> dict[str, float]:
    """Median and ninth decile of some times."""
    return {"median": float(np.median(seconds)), "p90": float(np.quantile(seconds, 0.9))} if seconds else {}


def timed(watch: type[DeckWatch]) -> list[float]:
    """Takes the time of each update of watches from now on, s."""
    took: list[float] = []
    update = watch.update

    def clocked(*args, **kwargs):
        start = time.perf_counter()
        alarms = update(*args, **kwargs)
        took.append(time.perf_counter() - start)
        return alarms

    watch.update = clocked  # pyright: ignore[reportAttributeAccessIssue]
    return took


def jams(stage: Stage, count: int, seed: int) -> dict[str, object]:
    """Jams of joints that the motion would move: which of them are named, and when."""
    rng = np.random.default_rng(seed)
    order = [stage.robot.joints.index(name) for name in stage.config.names] if stage.config else []
    pairs = []
    for motion, joints in joint_motions(stage.library, deepcopy(stage.robot.retarget)).items():
        for device, joint in enumerate(order):
            at = float(rng.uniform(0.5, 1.5))
            coming = joints[round(at * 30.0) : round((at + SOON) * 30.0), joint]
            if len(coming) and np.abs(coming - coming[0]).max() >= USED:
                pairs.append((motion, device, at))
    rng.shuffle(pairs)
    named: list[float] = []
    missed: list[str] = []
    mismatched = before = 0
    for motion, device, at in pairs[:count]:
        device, at = int(device), float(at)

        def jam(
            deck: Deck, watch: RecognitionWatch, port: EmulatedPort | None, device: int = device, at: float = at
        ) -> None:
            if port is not None and deck.time >= at:
                servo = port.bus.devices[device]
                servo.bank.drive.jammed[servo.row] = True

        alarms = stage.play(str(motion), at + SOON, jam).watch.alarms
        joint = stage.config.names[device] if stage.config else ""
        found = [alarm.at - at for alarm in alarms if alarm.joint == joint][:1]
        named += found
        missed += [] if found else [f"{joint} in {motion} from {at:.2f} s on"]
        mismatched += any(not alarm.joint for alarm in alarms)
        before += any(alarm.at < at for alarm in alarms)
    asked = max(len(pairs[:count]), 1)
    return {
        "jams": len(pairs[:count]),
        "of_possible": len(pairs),
        "named_within_2_s": len(named) / asked,
        "missed": missed,
        "named_after_s_median": float(np.median(named)) if named else None,
        "mismatch_within_2_s": mismatched / asked,
        "false_before_the_jam": before,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--every", type=float, default=6.0, help="seconds between two switches")
    parser.add_argument("--jams", type=int, default=60, help="how many joints are jammed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tempo", type=float, default=1.0, help="the deck's tempo")
    parser.add_argument("--robot", default="servo20")
    parser.add_argument("--simulated", action="store_true", help="the simulated robot itself, without a rig or jams")
    arguments = parser.parse_args()
    stage = Stage(arguments.robot, rig=not arguments.simulated, tempo=arguments.tempo)
    said = switching(stage, arguments.seconds, arguments.every, arguments.seed)
    print("switching is done", file=sys.stderr)
    if arguments.jams and not arguments.simulated:
        said |= jams(stage, arguments.jams, arguments.seed)
    print(json.dumps(said, indent=1))


if __name__ == "__main__":
    main()
