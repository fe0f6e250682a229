"""Delay of a jaw that gets 50 values a second over OSC, lost or cut off.

The head of examples/head talks on emulated servos, in simulated time, and its jaw gets values as datagrams whose bytes
are written here, through the stage's bridge and the deck's socket. Judged are the goals in the servo's own register,
read every millisecond, against the values of the sender and against a run without any. What the processes of a real run
add (a bridge that has to wake up, a busy machine) is not in it.

`lag` is the shift, ms, with which the goals are nearest to the voice, `off` what is then left, in shares of the jaw's
opening (root mean square and largest); `first` and `half` the times, ms, from a packet that opens the jaw to the first
change of the goal and to half of the way (median and longest). Of senders that die: how long, s, after the last packet
the goal leaves its value, and after how long it is back within 0.01 rad of the motion. `speed` and `acceleration` are
the largest of goals, over the limits of the rig file. Exits with 1 if a bar is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import socket
import struct
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from math import inf, pi, sin
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulated_time import EmulatedPort, VirtualClock
from controller.deck.deck import Deck
from controller.deck.layers import Layers
from controller.library.motion_library import MotionLibrary
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.loop import run
from controller.loop.output_channel import Channel
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.encodings.joint_angles import JointRetargeter
from controller.wire.command_socket import CommandClient, CommandServer
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import load_rig
from hardware.rig.supervision.rig import Rig
from motiondeck.run.robots.rig_on_deck import robot_of
from motiondeck.run.robots.rig_output import RigOutput
from motiondeck.stage.bridge import Bridge
from motiondeck.stage.command_pattern import CommandPattern
from motiondeck.stage.osc import OscInput

HEAD = Path(__file__).parents[2] / "examples" / "head"
RATE, EVERY = 200.0, 0.02  # ticks a second; s from value to value
BEGINS, LOOKS = 4.0, 0.001  # s: when the first value is sent, from look to look at the register
OPENING = 0.6  # rad, of the jaw
BARS = {"lag_ms": 50.0, "half_ms_max": 80.0, "back_s_max": 2.0, "speed": 1.0, "acceleration": 1.0}
PULSE = 2.0 * pi / 4096.0  # rad

Packets = Sequence[tuple[float, float]]
"""When each value is sent, s, and the value."""
Goals = NDArray[np.float64]


def voice(t: float) -> float:
    """How far a mouth is open, from 0 to 1."""
    return 0.5 + 0.22 * sin(2 * pi * 1.3 * t) + 0.18 * sin(2 * pi * 2.9 * t + 1.0) + 0.1 * sin(2 * pi * 4.7 * t + 2.0)


def osc_bytes(value: float) -> bytes:
    """The message /input/jaw with one float, as OSC 1.0 has it: texts end in zeros, to a multiple of four bytes."""
    return b"/input/jaw\0\0" + b",f\0\0" + struct.pack(">f", value)


class SendingClock(VirtualClock):
    """A clock whose waiting sends what is due, lets time pass on the bus, and looks at a goal register."""

    def __init__(self, packets: Packets, port: EmulatedPort, look: Callable[[], float]) -> None:
        super().__init__(RATE)
        self._packets, self._port, self._look = list(packets), port, look
        self.send: Callable[[float], None] = print
        self.goals: list[float] = []

    def wait(self) -> int:
        """Lets one period pass."""
        until = self.now() * 1e-9 + self.period
        while self._packets and self._packets[0][0] <= until:
            self.send(self._packets.pop(0)[1])
        for _ in range(round(self.period / LOOKS)):
            self._port.elapse(LOOKS)
            self.goals.append(self._look())
        return super().wait()


def jaw_goals(library: MotionLibrary, packets: Packets, seconds: float) -> Goals:
    """The goals of the jaw's servo, rad, every millisecond of a run."""
    config = load_rig(HEAD / "head.toml")
    robot = robot_of(HEAD / "head.toml", library.skeleton)
    port = EmulatedPort(EmulatedBus(config))
    for device in port.bus.devices:
        device["return_delay_time"] = 0  # as `rig doctor --fix` would
    rig = Rig(config, lambda part: Bus(port, part.baud), beside=False, sleep=port.elapse, spare=1.0)
    jaw = config.names.index("jaw")
    joint, device = config.joints[jaw], port.bus.devices[jaw]

    def twin() -> JointRetargeter:
        return JointRetargeter(library.skeleton, robot.joints, np.zeros(len(robot.joints)))

    deck = Deck(library, twin(), "talk")
    deck.layers = Layers(library, robot.joints, robot.limits, {}, twin)
    clock = SendingClock(packets, port, lambda: joint.angle(float(device["goal_position"])))
    refused: list[str] = []
    with ExitStack() as cleanup:
        server = cleanup.enter_context(closing(CommandServer(0)))
        listening = cleanup.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        listening.bind(("127.0.0.1", 0))
        address = listening.getsockname()
        listening.close()
        pattern = {"/input/jaw": CommandPattern("input jaw $1")}
        osc = cleanup.enter_context(closing(OscInput(address[1], pattern, refused.append)))
        client = cleanup.enter_context(closing(CommandClient(server.port)))
        bridge = Bridge(client, [osc], None, lambda *_: None, refused.append, lambda: clock.now() * 1e-9)
        sender = cleanup.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))

        def send(value: float) -> None:
            sender.sendto(osc_bytes(value), address)
            bridge.step(0.0)

        clock.send = send
        channel = Channel(RigOutput(rig, robot.joints, config.rate_hz), round(RATE / config.rate_hz))
        handler = CommandHandler(CommandedRun(deck), [server])
        envelope = SafetyEnvelope(robot.limits, clock.period)
        run(deck, [channel], clock, envelope, seconds=seconds, commands=handler)
        channel.output.close()
    if refused:
        raise SystemExit(f"the bridge says: {refused[0]}")
    return np.array(clock.goals)


def limits_used(goals: Goals) -> tuple[float, float]:
    """The largest speed and acceleration of goals over their limits, but for a pulse of the register."""
    hz, jaw = 100.0, load_rig(HEAD / "head.toml").joints[-1]
    sent = goals[:: round(1.0 / hz / LOOKS)]
    speed = (np.abs(np.diff(sent)).max() - PULSE) * hz / jaw.velocity
    change = (np.abs(np.diff(sent, n=2)).max() - 2.0 * PULSE) * hz**2 / (jaw.acceleration or inf)
    return float(speed), float(change)


def stream(library: MotionLibrary, lost: float, seconds: float, rng: np.random.Generator) -> dict[str, float]:
    """A voice of 50 values a second, each up to 3 ms early or late, of which a part is lost."""
    sent = [BEGINS + EVERY * n + rng.uniform(-0.003, 0.003) for n in range(round(seconds / EVERY))]
    packets = [(at, voice(at)) for at in sent if rng.random() >= lost]
    goals = jaw_goals(library, packets, BEGINS + seconds)
    times = LOOKS * (1.0 + np.arange(len(goals)))
    judged = (times > BEGINS + 1.0) & (times < BEGINS + seconds - 0.5)
    opened, at = goals[judged] / OPENING, times[judged]
    shifts = np.arange(0.0, 0.15, 0.001)
    errors = [opened - np.vectorize(voice)(at - shift) for shift in shifts]
    best = int(np.argmin([np.square(error).mean() for error in errors]))
    off = errors[best]
    speed, change = limits_used(goals[times > BEGINS - 0.5])
    found = {"lag_ms": 1e3 * shifts[best], "off_rms": np.sqrt(np.square(off).mean()), "off_most": np.abs(off).max()}
    return {key: round(float(value), 3) for key, value in (found | {"speed": speed, "acceleration": change}).items()}


def steps(library: MotionLibrary, count: int, rng: np.random.Generator) -> dict[str, float]:
    """Single packets, at any time of a tick, that open the jaw to 0.9 of it and close it to 0.1 again."""
    sent = [BEGINS + 0.4 * n + rng.uniform(0.0, 0.02) for n in range(2 * count)]
    packets = [(at, 0.9 if n % 2 else 0.1) for n, at in enumerate(sent)]
    goals = jaw_goals(library, packets, sent[-1] + 0.4)
    times = LOOKS * (1.0 + np.arange(len(goals)))
    first, half = [], []
    for at, value in packets[1::2]:
        after = times >= at
        moved, way = goals[after] - goals[np.argmax(after) - 1], 0.5 * OPENING * 0.8
        first.append(times[after][np.argmax(moved > 1.5 * PULSE)] - at)
        half.append(times[after][np.argmax(moved > way)] - at)
        assert value > 0.5
    speed, change = limits_used(goals[times > BEGINS - 0.5])
    delays = {"first_ms": first, "half_ms": half}
    found = {f"{key}_{kind.__name__}": 1e3 * kind(all_) for key, all_ in delays.items() for kind in (np.median, np.max)}
    return {key: round(float(value), 3) for key, value in (found | {"speed": speed, "acceleration": change}).items()}


def deaths(library: MotionLibrary, count: int, rng: np.random.Generator) -> dict[str, float]:
    """Senders that die after a second of voice, at any time of the motion, five seconds apart."""
    last = [BEGINS + 5.0 * n + 1.0 + rng.uniform(0.0, 1.0) for n in range(count)]
    packets = [(at - EVERY * n, 0.9) for at in last for n in reversed(range(50))]
    seconds = last[-1] + 3.0
    goals, alone = jaw_goals(library, packets, seconds), jaw_goals(library, [], seconds)
    times = LOOKS * (1.0 + np.arange(min(len(goals), len(alone))))
    apart = (goals - alone[: len(goals)])[: len(times)]
    leaves, back = [], []
    for at in last:
        after = (times > at) & (times < at + 2.5)
        leaves.append(times[after][np.argmax(np.abs(goals[: len(times)][after] - 0.9 * OPENING) > 0.01)] - at)
        back.append(times[after][np.flatnonzero(np.abs(apart[after]) > 0.01)[-1]] - at)
    speed, change = limits_used(goals[times > BEGINS - 0.5])
    found = {"leaves_s_least": np.min(leaves), "leaves_s_max": np.max(leaves)}
    found |= {"back_s_median": np.median(back), "back_s_max": np.max(back), "speed": speed, "acceleration": change}
    return {key: round(float(value), 3) for key, value in found.items()}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="of each stream")
    parser.add_argument("--times", type=int, default=50, help="steps and deaths")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    from controller.learning.fit import fit
    from controller.learning.recipe import gesture_recipe

    with tempfile.TemporaryDirectory() as folder:
        library = fit(gesture_recipe("faces", [HEAD / "talk.toml"]), Path(folder))
    rng = np.random.default_rng(given.seed)
    rows = {f"{lost:.0%} lost": stream(library, lost, given.seconds, rng) for lost in (0.0, 0.2)}
    rows |= {"steps": steps(library, given.times, rng), "dead senders": deaths(library, given.times, rng)}
    for name, row in rows.items():
        print(f"{name:<13}", json.dumps(row))
    missed = [
        f"{name}: {key} {row[key]}"
        for name, row in rows.items()
        for key, most in BARS.items()
        if row.get(key, 0.0) > most
    ]
    print("\n".join(missed) or "all bars kept")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
