"""The real-time loop: take commands, read, update, write, wait.

Nothing that happens inside a tick leaves it. An output that keeps raising is parked and the others go on; a deck that
raises leaves its last targets standing, and when it keeps raising the joints come to rest and the loop ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field

import msgspec

from controller.loop.clock import Clock
from controller.loop.guarded_calls import Attempts
from controller.loop.histogram import DurationHistogram, Percentiles
from controller.loop.output_channel import Channel
from controller.loop.quiet import undisturbed
from controller.loop.run_phases import Player, Source, course
from controller.loop.safety_envelope import SafetyEnvelope
from controller.loop.stop_requests import StopRequest, stop_on_signals
from controller.mocap.posture import Pose
from controller.rotations import Array


@dataclass
class LoopState:
    """What is known of a running loop, for telemetry; it changes with the next tick.

    Attributes:
        targets: what the outputs were given, shape (J,), rad.
        pose: where they come from.
        tick: how many ticks are done.
        seconds: for how long the loop has been running.
        overruns: ticks that came more than a period late.
        lateness, work: how late the ticks came and how long their work took.
        late_ns: how late the present tick came, ns.
        work_ns: how long the work of the tick before took, ns.
    """

    targets: Array
    pose: Pose
    tick: int = 0
    seconds: float = 0.0
    overruns: int = 0
    lateness: DurationHistogram = field(default_factory=DurationHistogram)
    work: DurationHistogram = field(default_factory=DurationHistogram)
    late_ns: int = 0
    work_ns: int = 0

    @property
    def rate(self) -> float:
        """Ticks per second since the start."""
        return self.tick / self.seconds if self.seconds > 0.0 else 0.0


class LoopReport(msgspec.Struct, frozen=True):
    """How a loop went.

    Attributes:
        rate_hz: ticks per second that were achieved.
        ticks: how many ran.
        overruns: how many came more than a period late.
        skipped: how many never ran, because the ones before took too long.
        lateness_us, work_us: how late they came and how long their work took, us.
        outputs: name, faults, parked and its own report for each output.
        reason: why the loop ended.
        faults: how often the deck, the commands and the telemetry have raised.
        changed: how many targets of each joint the safety envelope has changed.
    """

    rate_hz: float
    ticks: int
    overruns: int
    skipped: int
    lateness_us: Percentiles
    work_us: Percentiles
    outputs: list[dict[str, object]]
    reason: str
    faults: dict[str, int]
    changed: list[int]


def run(
    deck: Player,
    channels: Sequence[Channel],
    clock: Clock,
    envelope: SafetyEnvelope,
    *,
    seconds: float = math.inf,
    rest: Array | None = None,
    commands: Callable[[StopRequest], None] | None = None,
    publish: Callable[[LoopState], None] | None = None,
    publish_every: int = 4,
    stop: StopRequest | None = None,
) -> LoopReport:
    """Plays a deck on outputs until the time is over, or until a command, a signal or a failure ends it.

    The joints approach the deck's first targets slowly from where an output measures them to be; where none does, they
    are taken to be there. At the end they come to rest within their limits. Outputs are left open.

    Args:
        deck: is asked for targets once a tick. What its very first update raises is raised here: nothing moves yet.
        channels: the outputs; when all of them are parked the loop ends.
        clock: says when the next tick is due.
        envelope: what every target passes, made for the period of the clock.
        seconds: how long to play; approach and stop are not counted.
        rest: joint positions (J,), rad, to go to in the end; without them the joints stay where they stop.
        commands: carries out the commands that have come; it may ask for a stop, and must not wait.
        publish: is shown the state every `publish_every` ticks; it must not wait.
        stop: ends the loop when it is asked for; before the first tick nothing moves at all. By itself the loop's own,
            which signals ask for.
    """
    source = Source(deck, clock.period)
    commanding, publishing = Attempts(), Attempts()
    with undisturbed(), nullcontext(stop) if stop is not None else stop_on_signals() as stop:
        state = LoopState(envelope.position, source.pose)
        steps = course(source, channels, envelope, stop, seconds, rest)
        clock.start()
        start = clock.now()
        try:
            while True:
                began = clock.now()
                if commands:
                    commanding(commands, stop)
                for channel in channels:
                    channel.read(state.tick)
                targets = next(steps, None)
                if targets is None:
                    break
                for channel in channels:
                    channel.write(state.tick, targets, source.pose)
                state.targets, state.pose = targets, source.pose
                if publish and state.tick % publish_every == 0:
                    publishing(publish, state)
                state.work_ns = clock.now() - began
                state.work.add(state.work_ns)
                state.late_ns = clock.wait()
                state.lateness.add(state.late_ns)
                state.tick += 1
                state.overruns = clock.overruns
                state.seconds = (clock.now() - start) * 1e-9
                if channels and all(channel.parked for channel in channels):
                    faults = "; ".join(f"{channel.output.name}: {channel.fault}" for channel in channels)
                    stop.ask(f"every output is parked ({faults})")
                    break
        except KeyboardInterrupt:
            stop.reason = "stopped at once by a second signal"
    return LoopReport(
        rate_hz=state.rate,
        ticks=state.tick,
        overruns=state.overruns,
        skipped=clock.skipped,
        lateness_us=state.lateness.percentiles(),
        work_us=state.work.percentiles(),
        outputs=[channel.report() for channel in channels],
        reason=stop.reason,
        faults={"deck": source.attempts.faults, "commands": commanding.faults, "telemetry": publishing.faults},
        changed=envelope.changed.tolist(),
    )
