"""The real-time loop: take commands, read, update, write, wait.

No exception leaves a tick. An output that keeps raising is parked and the others go on. While the deck raises its last
targets are held; if it keeps raising, the joints come to rest and the loop ends.

Ticks that run at once after a stall advance the deck, but are not written faster than time passes (see `pace`).
"""

import gc
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field

import msgspec
from threadpoolctl import threadpool_limits

from controller.loop.clock import Clock
from controller.loop.correction import Correction
from controller.loop.histogram import DurationHistogram, Percentiles
from controller.loop.lead import Lead
from controller.loop.output_channel import Channel, FaultCounter
from controller.loop.run_phases import Player, Source, safe_targets
from controller.loop.safety.pace import Pace
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.loop.stop_requests import StopRequest, stop_on_signals
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose

_DEAF = 5  # ticks in a row in which nothing can be commanded, or no stop be taken, after which the joints come to rest


@dataclass
class LoopState:
    """The state of a running loop, for telemetry; the next tick changes it."""

    targets: Array  # safe targets that the joints are meant to be at now, shape (J,), rad
    pose: Pose
    tick: int = 0
    seconds: float = 0.0  # s since the loop started
    overruns: int = 0
    lateness: DurationHistogram = field(default_factory=DurationHistogram)  # how late ticks began
    work: DurationHistogram = field(default_factory=DurationHistogram)  # how long their work took
    late_ns: int = 0  # lateness of the present tick, ns
    work_ns: int = 0  # work of the tick before, ns
    began_ns: int = 0  # when the present tick began, by the loop's clock, ns

    @property
    def rate(self) -> float:
        """Ticks per second since the start."""
        return self.tick / self.seconds if self.seconds > 0.0 else 0.0


class LoopReport(msgspec.Struct, frozen=True):
    """The result of a loop."""

    rate_hz: float
    ticks: int
    overruns: int  # how many began more than a period late
    skipped: int  # how many never ran, because the ones before took too long
    lateness_us: Percentiles
    work_us: Percentiles
    outputs: list[dict[str, object]]  # for each output its name, faults, whether it was parked, and its own report
    reason: str
    faults: dict[str, int]  # how often the deck, the commands, the sources of stops and the telemetry have raised
    changed: list[int]  # for each joint how many targets the safety envelope has changed


@contextmanager
def undisturbed() -> Iterator[None]:
    """Keeps the garbage collector off and BLAS at one thread inside; both are restored afterwards."""
    # Existing objects are frozen, so that no collection visits them. Two BLAS threads wait for one another, which costs
    # the loop milliseconds at p99.
    collecting = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        with threadpool_limits(1):
            yield
    finally:
        gc.unfreeze()
        if collecting:
            gc.enable()


def run(
    deck: Player,
    channels: Sequence[Channel],
    clock: Clock,
    envelope: SafetyEnvelope,
    *,
    seconds: float = math.inf,
    rest: Array | None = None,
    commands: Callable[[StopRequest], None] | None = None,
    stops: Sequence[Callable[[StopRequest], None]] = (),
    publish: Callable[[LoopState], None] | None = None,
    publish_every: int = 4,
    stop: StopRequest | None = None,
    lead: Lead | None = None,
    correction: Correction | None = None,
) -> LoopReport:
    """Plays a deck on outputs until the time is over, or until a command, a signal or a failure ends it.

    The joints approach the deck's first targets slowly from their measured positions; joints that no output measures
    are assumed to be at those targets. At the end they come to rest within their limits. Outputs are left open. Where
    joints lag, the deck runs ahead of the picture (see `lead`).

    Args:
        deck: updated once a tick. An exception of its first update is raised here: nothing has moved yet.
        channels: the outputs; when all of them are parked the loop ends.
        seconds: how long to play; approach and stop are not counted.
        rest: joint positions (J,), rad, to end at; without them the joints stay where they stop.
        commands: carries out commands once a tick; it may request a stop, and must not wait. If it keeps raising, the
            joints come to rest and the loop ends: a deck that nothing can stop must not play on.
        stops: the sources of the emergency stop, each asked once a tick, as `commands`, and apart from them: one that
            keeps raising ends the loop, and the others go on until the joints are at rest.
        publish: called with the state every `publish_every` ticks; it must not wait.
        stop: ends the loop when set; if set before the first tick nothing moves. By default one that signals set.
        lead: of these channels, if it was needed before the loop; by default the loop makes it.
        correction: of the targets of outputs with the attribute `correction`; the picture is without it.
    """
    lead = lead or Lead(channels, len(envelope.position), clock.period)
    lead.begin()
    source = Source(deck, clock.period, lead.before if lead.delays.any() else None, correction)
    commanding, publishing = FaultCounter(most=_DEAF), FaultCounter()
    stopping = [FaultCounter(most=_DEAF) for _ in stops]
    with undisturbed(), nullcontext(stop) if stop is not None else stop_on_signals() as stop:
        state = LoopState(envelope.position, source.pose)
        steps = safe_targets(source, channels, envelope, stop, seconds, rest)
        clock.start()
        began = start = state.began_ns = clock.now()
        pace = Pace(clock.period)
        try:
            while True:
                for source_of_stops, counter in zip(stops, stopping, strict=True):
                    counter.call(source_of_stops, stop)
                    if counter.given_up:
                        stop.ask(f"an emergency stop cannot be taken: {counter.fault}")
                if commands:
                    commanding.call(commands, stop)
                    if commanding.given_up:
                        stop.ask(f"commands keep failing: {commanding.fault}")
                for channel in channels:
                    channel.read(state.tick)
                if pace.may_write(began):
                    targets = next(steps, None)
                    if targets is None:
                        break
                    state.targets, state.pose = targets, source.pose
                    if lead.seconds or correction is not None:
                        added = correction.added() if correction is not None else None
                        state.targets, state.pose = lead.write(state.tick, targets, source.pose, added)
                        if correction is not None:
                            correction.end_tick(state.targets)
                    else:
                        for channel in channels:
                            channel.write(state.tick, targets, source.pose)
                elif source.running:  # of a tick that is not written; while joints approach it, the deck waits
                    source.update()
                if publish and state.tick % publish_every == 0:
                    publishing.call(publish, state)
                state.work_ns = clock.now() - began
                state.work.add(state.work_ns)
                state.late_ns = clock.wait()
                state.lateness.add(state.late_ns)
                state.tick += 1
                state.overruns = clock.overruns
                began = state.began_ns = clock.now()
                state.seconds = (began - start) * 1e-9
                if channels and channels[-1].parked and all(channel.parked for channel in channels):
                    faults = "; ".join(f"{channel.name}: {channel.fault}" for channel in channels)
                    stop.ask(f"every output is parked ({faults})")
                    break
        except KeyboardInterrupt:
            stop.reason = "stopped at once by a second signal"
    counters = {"deck": [source.counter], "commands": [commanding], "stops": stopping, "telemetry": [publishing]}
    return LoopReport(
        rate_hz=state.rate,
        ticks=state.tick,
        overruns=state.overruns,
        skipped=clock.skipped,
        lateness_us=state.lateness.percentiles(),
        work_us=state.work.percentiles(),
        outputs=[channel.report() for channel in channels],
        reason=stop.reason,
        faults={name: sum(counter.faults for counter in own) for name, own in counters.items()},
        changed=envelope.changed.tolist(),
    )
