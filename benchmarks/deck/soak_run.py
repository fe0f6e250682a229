"""A soak: hours of commands and faults on virtual time, with all invariants checked in every tick.

A library's deck plays through the safety envelope while commands come at random, over the socket as from any client,
amid nonsense and floods; outputs raise and return NaN, the deck itself raises. What must hold: each target is finite
and inside its position, velocity, acceleration and jerk limits; under the emergency stop the joints come to rest and
stay; every command is answered; nothing grows.
"""

from __future__ import annotations

import math
import socket
import sys
from collections.abc import Callable, Mapping
from contextlib import closing, suppress

import msgspec
import numpy as np

from benchmarks.deck.memory_growth import Growth, growth, memory_kb
from benchmarks.simulated_time import VirtualClock
from controller.deck.deck import Deck
from controller.deck.interfaces import JointLimits, Retargeter
from controller.deck.switch import CommandedSwitch
from controller.deck.switch_plan import REMEMBERED_SWITCHES
from controller.library.motion_library import MotionLibrary
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.loop import LoopState, run
from controller.loop.output_channel import Channel
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.loop.stop_requests import StopRequest
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from controller.wire.command_socket import CommandServer
from controller.wire.local_transport import command_folder
from controller.wire.messages.commands import (
    Blend,
    DeckCommand,
    EmergencyStop,
    GetStatus,
    Home,
    Pause,
    Queue,
    Reset,
    Resume,
    SetTempo,
    Switch,
    encode,
)
from controller.wire.messages.replies import read_reply

COMMAND_EVERY_S = 0.5
FAULT_SHARE = 0.01
LOOK_AT_MEMORY_EVERY_S = 10.0
STOPPED_WITHIN_S = 2.0
_ROUNDING = 1e-6


class SoakReport(msgspec.Struct, frozen=True):
    """What a soak has seen.

    Attributes:
        seconds: of virtual time.
        ticks: how many.
        commands: how many were sent, nonsense and floods left out.
        answered: how many of them were answered.
        flood: datagrams of nonsense and of floods.
        faults: how often the deck, the commands and the outputs have raised.
        outside: targets that were not finite or outside one of the four limits.
        restless: ticks in which a joint moved although the emergency stop had been on for STOPPED_WITHIN_S.
        growth_kb_per_hour: of the memory in use (RSS) over the second half, an hour of virtual time.
        growth_blocks_per_hour: likewise of the blocks that Python has allocated.
        reason: why it ended.
    """

    seconds: float
    ticks: int
    commands: int
    answered: int
    flood: int
    faults: dict[str, int]
    outside: int
    restless: int
    growth_kb_per_hour: Growth
    growth_blocks_per_hour: Growth
    reason: str

    @property
    def passed(self) -> bool:
        """Whether all that must hold has held; memory is judged by who reads the report."""
        return (
            self.outside == self.restless == self.faults["commands"] == 0
            and self.answered == self.commands
            and self.reason == "played to the end"
        )


class Shaky:
    """An output that raises now and then, says NaN, and keeps watch over what it is given."""

    name = "shaky"

    def __init__(self, limits: JointLimits, dt: float, rng: np.random.Generator) -> None:
        self._bounds = [
            limit * dt**order * (1.0 + _ROUNDING)
            for order, limit in ((1, limits.velocity), (2, limits.acceleration), (3, limits.jerk))
        ]
        self._limits, self._rng = limits, rng
        self._last: list[Array] = []
        self._failed = False
        self.outside = 0
        self.moved = False

    def write(self, targets: Array, pose: Pose) -> None:
        """Checks the targets against all four limits; raises by chance, but never often enough to be parked."""
        limits = self._limits
        fine = np.isfinite(targets) & (targets >= limits.lower) & (targets <= limits.upper)
        self._last = [*self._last[-3:], targets.copy()]
        self.moved = len(self._last) > 1 and not np.array_equal(self._last[-1], self._last[-2])
        history = np.array(self._last)
        for order, bound in enumerate(self._bounds, start=1):
            if len(history) > order:
                fine &= np.abs(np.diff(history, n=order, axis=0)[-1]) <= bound
        self.outside += int(np.count_nonzero(~fine))
        self._failed = not self._failed and bool(self._rng.random() < FAULT_SHARE)
        if self._failed:
            raise OSError("the cable is loose")

    def measured(self) -> Array | None:
        """Where the joints are, or nonsense."""
        return np.full(len(self._limits.lower), math.nan) if self._rng.random() < FAULT_SHARE else None

    def report(self) -> Mapping[str, object]:
        """Nothing."""
        return {}

    def close(self) -> None:
        """Nothing to let go of."""


class ShakyDeck(Deck):
    """A deck that raises and jumps now and then."""

    def shake(self, rng: np.random.Generator) -> None:
        """Says by which numbers."""
        self._rng = rng

    def update(self, dt: float) -> tuple[Array, Pose]:
        """As a deck does it, or not."""
        targets, pose = super().update(dt)
        chance = self._rng.random()
        if self.time > 2.0 * dt and chance < FAULT_SHARE:
            if chance < 0.3 * FAULT_SHARE:
                raise RuntimeError("the deck is shaken")
            targets = targets.copy()
            targets[self._rng.integers(len(targets))] = self._rng.choice([math.nan, math.inf, 1e3, -1e3])
        return targets, pose


def soak(
    library: MotionLibrary,
    retarget: Retargeter,
    limits: JointLimits,
    seconds: float,
    rate: float = 200.0,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> SoakReport:
    """Lets a library's deck play for so long, and says what was seen; the same seed does the same.

    Args:
        library: what is played.
        retarget: to the robot's joints.
        limits: of the joints.
        seconds: of virtual time.
        rate: ticks a second.
        seed: of commands and faults.
        progress: is told the seconds that are over, now and then.
    """
    rng = np.random.default_rng(seed)
    clock = VirtualClock(rate)
    deck = ShakyDeck(library, retarget, library.network.motions[0])
    deck.shake(np.random.default_rng(rng.integers(2**32)))
    # The record of the latest switches is full from the start, or it would look like growth for half an hour.
    deck.switches.extend(CommandedSwitch(deck.motions[0], 0.0, 0.0, 0.0) for _ in range(REMEMBERED_SWITCHES))
    output = Shaky(limits, clock.period, np.random.default_rng(rng.integers(2**32)))
    every = max(1, round(COMMAND_EVERY_S * rate))
    look_every = max(1, round(LOOK_AT_MEMORY_EVERY_S * rate))
    memory: list[tuple[float, float, float]] = []
    commands = answered = flood = restless = halted = tick = 0
    with (
        closing(CommandServer(0)) as server,
        closing(_socket(server.port)) as client,
        closing(_socket(server.port)) as flooder,
    ):
        desk = CommandHandler(CommandedRun(deck), [server])

        def command(stop: StopRequest) -> None:
            nonlocal commands, answered, flood, restless, halted, tick
            tick += 1
            if tick % every == 0:
                commands += 1
                client.send(encode(random_command(rng, deck.motions, commands)))
                for _ in range(int(rng.integers(0, 60))):
                    flood += 1
                    with suppress(OSError):
                        flooder.send(_NONSENSE[int(rng.integers(len(_NONSENSE)))])
            desk(stop)
            answered += _answers(client, commands)
            _answers(flooder, 0)
            halted = halted + 1 if stop.emergency else 0
            restless += halted > STOPPED_WITHIN_S * rate and output.moved
            if tick % look_every == 0:
                memory.append((tick / rate, memory_kb(), sys.getallocatedblocks()))
                if progress is not None:
                    progress(tick / rate)

        def publish(state: LoopState) -> None:
            if state.tick % 97 == 0:
                raise OSError("a reader has died")

        report = run(
            deck,
            [Channel(output)],
            clock,
            SafetyEnvelope(limits, clock.period),
            seconds=seconds,
            commands=command,
            publish=publish,
        )
    outputs = report.outputs[0]["faults"]
    settled = memory[len(memory) // 2 :]
    return SoakReport(
        seconds=report.ticks / rate,
        ticks=report.ticks,
        commands=commands,
        answered=answered,
        flood=flood,
        faults=report.faults | {"outputs": outputs if isinstance(outputs, int) else 0},
        outside=output.outside,
        restless=restless,
        growth_kb_per_hour=growth([(at, kb) for at, kb, _ in settled]),
        growth_blocks_per_hour=growth([(at, blocks) for at, _, blocks in settled]),
        reason=report.reason,
    )


_NONSENSE = (b" ", b"nonsense", b"[" * 2000, b"x" * 3000, b'{"type":"switch","to":"nothing"}', encode(GetStatus(id=7)))


def random_command(rng: np.random.Generator, motions: tuple[str, ...], number: int) -> DeckCommand:
    """Some command; after an emergency stop the next ones release it soon."""
    motion = str(rng.choice(motions))
    kinds: list[DeckCommand] = [
        *[Switch(motion, id=number)] * 5,
        Switch(motion, id=number, direct=True),
        *[Queue(motion, id=number)] * 2,
        *[Blend(motion, str(rng.choice(motions)), float(rng.uniform()), id=number)] * 2,
        SetTempo(float(rng.uniform(0.1, 3.0)), id=number),
        Pause(id=number),
        *[Resume(id=number)] * 3,
        Home(id=number),
        EmergencyStop(id=number),
        *[Reset(id=number)] * 3,
    ]
    return kinds[int(rng.integers(len(kinds)))]


def _socket(port: int) -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    made.setblocking(False)
    made.connect(str(command_folder() / str(port)))
    return made


def _answers(client: socket.socket, newest: int) -> int:
    """How many first answers to the newest command have come; all others are thrown away."""
    count = 0
    with suppress(OSError):
        while True:
            reply = read_reply(client.recv(65536))
            count += reply.id == newest and reply.__struct_config__.tag in ("accepted", "refused", "state")
    return count
