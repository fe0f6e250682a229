"""Recognition from the measured joints of an emulated rig, and jams:  python -m benchmarks.recognition_on_the_rig

Plays the shipped library on the emulated 20-servo rig in simulated time, switches at random every 6 s for 10 minutes,
and then jams joints, one at a time, at whatever position they are in. Prints one JSON object: when the right motion was
seen, false alarms, jams found, and what watching costs a tick. Options: --seconds S, --every S, --jams N, --seed N.
"""

from __future__ import annotations

import argparse
import json
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from abc import ABC, abstractmethod
from pathlib import Path

import numpy as np

from controller.cli.resources import find
from controller.cli.rig_output import RigOutput
from controller.realtime.channel import Channel
from controller.realtime.clock import VirtualClock
from controller.realtime.deck import Deck
from controller.realtime.loop import LoopState, run
from controller.realtime.safety import SafetyEnvelope
from controller.recognition.deck_recognizer import JointWatcher, joint_motions, teach_joints
from controller.recognition.following import FollowingWatch
from controller.recognition.online import MismatchWatch
from controller.training.library import load_library
from hardware.bus import Bus
from hardware.dynamixel_rig import DynamixelRig
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.port import EmulatedPort
from hardware.rig import load_rig
from sim.robot import load_robot

RATE = 100.0
USED = 0.3  # rad: a motion uses a joint that moves at least so far


class SimulatedClock(VirtualClock):
    """A clock whose waiting lets time pass on the emulated bus."""

    port: EmulatedPort

    def wait(self) -> int:
        """Lets one period pass, here and on the bus."""
        self.port.elapse(self.period)
        return super().wait()


class Stage:
    """Robot, library and experts; each run gets a rig of its own."""

    def __init__(self) -> None:
        self.library = load_library(find("library", "thesis15", ".safetensors"))
        self.robot = load_robot(find("robot", "servo20", ".toml"), self.library.skeleton)
        self.config = load_rig(Path(find("rig", "servo20", ".toml")))
        self.order = np.array([self.robot.joints.index(name) for name in self.config.names])
        start = time.perf_counter()
        limits = self.robot.limits
        self.motions = {
            name: np.clip(joints, limits.lower, limits.upper)[:, self.order]
            for name, joints in joint_motions(self.library, self.robot.retarget).items()
        }
        self.bank = teach_joints(self.motions)
        self.taught_s = time.perf_counter() - start

    def play(self, motion: str, seconds: float, observer: Observer) -> dict[str, object]:
        """Plays from one motion on, and returns what the rig reports."""
        port = EmulatedPort(EmulatedBus(self.config))
        rig = DynamixelRig(self.config, Bus(port, self.config.baud))
        channel = Channel(RigOutput(rig, self.robot.joints, self.config.rate_hz), round(RATE / self.config.rate_hz))
        clock = SimulatedClock(RATE)
        clock.port = port
        deck = Deck(self.library, self.robot.retarget, motion)
        observer.begin(deck, channel, port)
        run(
            deck,
            [channel],
            clock,
            SafetyEnvelope(self.robot.limits, clock.period),
            seconds=seconds,
            publish=observer.observe,
            publish_every=1,
        )
        said = channel.report()
        rig.close()
        return said


class Observer(ABC):
    """Watches a run tick by tick; the approach at the start and the stop at the end are not looked at."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.watcher = JointWatcher(stage.bank)
        self.mismatch = MismatchWatch(self.watcher.recognizer)
        self.following = FollowingWatch(len(stage.order), RATE)
        self.cost: list[float] = []

    def begin(self, deck: Deck, channel: Channel, port: EmulatedPort) -> None:
        """Takes what the run consists of."""
        self.deck, self.channel, self.port, self.time = deck, channel, port, deck.time

    def observe(self, state: LoopState) -> None:
        """Takes in one tick."""
        measured = self.channel.measured
        if measured is None or self.deck.time == self.time:
            return
        self.time = self.deck.time
        start = time.perf_counter()
        joints = measured[self.stage.order]
        self.watcher.update(joints, 1.0 / RATE)
        wrong = self.mismatch.update(self.deck.motion, self.deck.settled, 1.0 / RATE)
        stuck = self.following.update(state.targets[self.stage.order], joints)
        seen = self.watcher.recognizer.motion
        self.cost.append(time.perf_counter() - start)
        self.take(seen, wrong, stuck)

    @abstractmethod
    def take(self, seen: str | None, wrong: bool, stuck) -> None:
        """Takes what was seen in one tick, and whether the two watches raise their voices."""


class Switching(Observer):
    """Switches at random, and notes when the right motion is seen."""

    def __init__(self, stage: Stage, every: float, seed: int) -> None:
        super().__init__(stage)
        self.every, self.rng = every, np.random.default_rng(seed)
        self.since, self.seen_at, self.settled_at = 0.0, None, None
        self.after_command: list[float] = []
        self.after_fade: list[float] = []
        self.never: list[str] = []
        self.right = self.asked = self.mismatch_ticks = self.stuck_ticks = 0

    @abstractmethod
    def take(self, seen: str | None, wrong: bool, stuck) -> None:
        """Takes what was seen in one tick, and whether the two watches raise their voices."""
        deck = self.deck
        self.mismatch_ticks += wrong
        self.stuck_ticks += bool(stuck.any())
        self.since += 1.0 / RATE
        if deck.settled and self.settled_at is None:
            self.settled_at = self.since
        if seen == deck.motion and self.seen_at is None:
            self.seen_at = self.since
        if self.settled_at is not None and self.since > self.settled_at + 0.7:
            self.asked += 1
            self.right += seen == deck.motion
        if self.since >= self.every:
            if self.settled_at is None:
                pass  # the switch itself took longer than that: it was never shown
            elif self.seen_at is None:
                self.never.append(deck.motion)
            else:
                self.after_command.append(self.seen_at)
                self.after_fade.append(self.seen_at - self.settled_at)
            deck.switch(str(self.rng.choice([name for name in deck.motions if name != deck.motion])))
            self.since, self.seen_at, self.settled_at = 0.0, None, None


class Jamming(Observer):
    """Jams one joint after a second, wherever it is, and notes when it is named."""

    def __init__(self, stage: Stage, joint: int, at: float) -> None:
        super().__init__(stage)
        self.joint, self.at = joint, at
        self.named: float | None = None
        self.mismatched: float | None = None
        self.others = False

    @abstractmethod
    def take(self, seen: str | None, wrong: bool, stuck) -> None:
        """Takes what was seen in one tick, and whether the two watches raise their voices."""
        if self.deck.time < self.at:
            self.others |= bool(stuck.any())
            return
        device = self.port.bus.devices[self.joint]
        device.bank.drive.jammed[device.row] = True
        if stuck[self.joint] and self.named is None:
            self.named = self.deck.time - self.at
        if wrong and self.mismatched is None:
            self.mismatched = self.deck.time - self.at


def jams(stage: Stage, count: int, seed: int) -> dict[str, object]:
    rng = np.random.default_rng(seed)
    pairs = []
    for motion, joints in stage.motions.items():
        for joint in range(joints.shape[1]):
            at = float(rng.uniform(0.5, 1.5))
            coming = joints[round(at * 30.0) : round((at + 2.0) * 30.0), joint]
            if len(coming) and np.abs(coming - coming[0]).max() >= USED:
                pairs.append((motion, joint, at))
    rng.shuffle(pairs)
    found = []
    for motion, joint, at in pairs[:count]:
        observer = Jamming(stage, int(joint), float(at))
        stage.play(str(motion), float(at) + 2.0, observer)
        found.append((observer.named, observer.mismatched, observer.others))
    named = [seconds for seconds, _, _ in found if seconds is not None]
    return {
        "jams": len(found),
        "of_possible": len(pairs),
        "named_within_2_s": len(named) / max(len(found), 1),
        "named_after_s_median": float(np.median(named)) if named else None,
        "mismatch_within_2_s": sum(m is not None for _, m, _ in found) / max(len(found), 1),
        "false_before_the_jam": sum(others for _, _, others in found),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--every", type=float, default=6.0)
    parser.add_argument("--jams", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    stage = Stage()
    switching = Switching(stage, arguments.every, arguments.seed)
    rig = stage.play(next(iter(stage.motions)), arguments.seconds, switching)
    said: dict[str, object] = {
        "taught_s": stage.taught_s,
        "switches": len(switching.after_command) + len(switching.never),
        "seen_after_command_s_median": float(np.median(switching.after_command)),
        "seen_after_fade_s_median": float(np.median(switching.after_fade)),
        "seen_after_fade_s_p90": float(np.quantile(switching.after_fade, 0.9)),
        "shown_but_never_seen": switching.never,
        "right_share_from_0.7_s_after_the_fade": switching.right / max(switching.asked, 1),
        "false_mismatch_ticks": switching.mismatch_ticks,
        "false_stuck_ticks": switching.stuck_ticks,
        "ticks": len(switching.cost),
        "cost_us_median": float(np.median(switching.cost)) * 1e6,
        "rig_parked": rig["parked"],
    }
    if arguments.jams:
        said |= jams(stage, arguments.jams, arguments.seed)
    print(json.dumps(said, indent=1))


if __name__ == "__main__":
    main()
