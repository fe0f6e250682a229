"""Builds the parts of a run from its spec: sockets, page, robots, deck, recorder, prompt."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from copy import deepcopy
from pathlib import Path
from typing import TYPE_CHECKING

from controller.deck.deck import Deck
from controller.deck.layers import Layers
from controller.deck.recorded_deck import RecordedDeck
from controller.library.motion_library import MotionLibrary
from controller.loop.clock import Ticker
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.commands.interfaces import PlayableDeck
from controller.loop.commands.snapshots import SnapshotSource
from controller.loop.ensemble import all_limits, together
from controller.loop.lead import Lead
from controller.loop.output_channel import Channel
from controller.loop.permissions import handed_back, leave_core
from controller.loop.safety.compiled_envelope import safety_envelope
from controller.loop.stop_requests import StopRequest, stop_on_signals
from controller.loop.stop_state import STOP_DOOR, WiredStop
from controller.motion.rotations import Array
from controller.wire.command_socket import CommandServer
from controller.wire.leader_link import LeaderLink
from controller.wire.stop_door import StopDoor
from motiondeck.run.beside.child_process import Children, child_process, kept_tty, page_process
from motiondeck.run.report import RunNews
from motiondeck.run.robots.robot_on_deck import RobotOnDeck, channels_of
from motiondeck.run.session import ALONE, Host, Played, Session, watch_wire
from motiondeck.run.spec.run_spec import RunSpec, is_emulated
from motiondeck_base.shipped import find_rig

if TYPE_CHECKING:  # a run imports what it has: page, show, recorder, recognition, rig, outputs
    from motiondeck.run.beside.tick_recorder import TickRecorder
    from motiondeck.run.guard.guarded_rig import GuardedRig
    from motiondeck.run.recognition.watches import Watch
    from motiondeck.run.robots.rig_output import RigOutput


@contextmanager
def open_session(spec: RunSpec, played: Played, host: Host = ALONE) -> Iterator[Session]:
    """A run while the block runs; MotiondeckError if a file, a port or a rig cannot be used."""
    with ExitStack() as opening:
        # From here on a signal asks for a stop: what has been opened is closed in order.
        stop = opening.enter_context(stop_on_signals())
        with handed_back():
            if spec.core is not None:
                leave_core(spec.core)  # for the processes that are started now
            session = _assemble(opening, stop, spec, played, host)
        yield session


def _assemble(opening: ExitStack, stop: StopRequest, spec: RunSpec, played: Played, host: Host) -> Session:
    """Opens everything; the page takes longest to start, so it starts first and waits for the rest."""
    children = Children()
    servers = _servers(opening, spec)
    port = servers[-1].port
    page = host.page
    if page is None and spec.page_port is not None:
        page = opening.enter_context(page_process(spec.page_port, spec.command_port))
    if page is not None:
        children.add("the page", page.process)
    member = None
    if spec.show is not None and isinstance(played.source, MotionLibrary):
        from motiondeck.run.beside.show_member import show_member

        show = str(spec.show), port, played.source, Path(spec.robot or spec.rig_named).stem, spec.rate
        member = opening.enter_context(show_member(*show))
        then = "no cue and no emergency stop of the show reaches this deck until it is started again"
        children.add("the part in the show", member.process, then)

    robots = played.open_robots(opening)
    first, body = robots[0], robots[0].pushable
    deck = played.make_deck(together([robot.retarget for robot in robots]))
    joints = [name for robot in robots for name in robot.joints]
    servos = _servos(first)
    guarded = [rig.guarded for rig in map(_servos, robots) if rig is not None and rig.guarded is not None]
    for rig in guarded:
        rig.stop = stop.state
    count_presses, wired = _stop_sources(opening, spec, port, guarded[0] if guarded else None)
    channels = channels_of(robots)
    if spec.outputs:
        from motiondeck.run.plugin_outputs import open_outputs

        channels += open_outputs(opening, spec.outputs, joints, spec.rate)
    clock = host.clock or Ticker(spec.rate, "catch_up" if spec.overruns == "catch-up" else "skip")
    ticker = clock if isinstance(clock, Ticker) else None
    for pushable in filter(None, (robot.pushable for robot in robots)):
        # The clock of its events is the deck's, as of all others; the approach comes before.
        pushable.attach(lambda: deck.time, lambda: stop.holds)
    channel, own = channels[0], len(first.own_joints)

    def measured() -> Array | None:
        return None if channel.measured is None else channel.measured[:own]

    lead = Lead(channels, len(joints), clock.period)
    deck.lead = lead.seconds
    correction = None
    if isinstance(deck, Deck):
        leader = member.leader(opening) if member is not None else None
        if spec.lock_to not in (None, "beat", "body"):
            leader = opening.enter_context(closing(LeaderLink.to(str(spec.lock_to))))
        deck.due = ticker.due if ticker is not None else None
        deck.measured, deck.leader = measured, leader
        if spec.lock_to is not None:
            deck.lock("beat" if spec.lock_to == "beat" else "body" if spec.lock_to == "body" else "deck")
    if isinstance(deck, Deck) and isinstance(played.source, MotionLibrary):
        deck.layers = _layers(played.source, robots)
        if servos is not None and len(robots) == 1:
            from motiondeck.run.robots.learned_follow import open_correction

            parts, emulated = (opening, servos, deck, lead, first.limits, clock.period), is_emulated(spec.rig)
            correction = open_correction(*parts, robot=first.name, library=played.source.info, emulated=emulated)
    watch = _watch(spec, played, first, channels[0])
    guards = [robot.guard for robot in robots if robot.guard is not None]
    kept_apart = (lambda: sum(guard.kept_apart.total() for guard in guards)) if guards else None
    snapshots = SnapshotSource(deck, body, watch, kept_apart)
    shown = None
    if page is not None:
        from motiondeck.run.page.page import Page, PageContents

        # Of a recorded run only the human's root is known, and joints taught by hand were never a human's.
        human = None if isinstance(deck, RecordedDeck) or played.source.skeleton.is_rig else played.source.skeleton
        files = played.file, played.network_file
        contents = PageContents(deck, robots, human, watch, port, *files, servos, host.restarts, played.verdicts)
        shown = opening.enter_context(closing(Page.open(page.state, contents)))
    recorder = _recorder(opening, spec, played, first, deck, watch)
    if recorder is not None:
        children.add("the recorder", recorder.process)
    run = CommandedRun(deck, servos, body, host.restarts, ticker, snapshots=snapshots)
    handler = CommandHandler(run, servers, recorder and recorder.note, tell=recorder and recorder.tell)
    session = Session(
        spec=spec,
        played=played,
        host=host,
        stop=stop,
        robots=robots,
        deck=deck,
        channels=channels,
        clock=clock,
        envelope=safety_envelope(all_limits([robot.limits for robot in robots]), clock.period),
        snapshots=snapshots,
        handler=handler,
        news=RunNews(handler, clock, channels, servers, watch),
        measured=measured,
        children=children,
        command_port=port,
        page_port=page.port if page is not None else None,
        stops=[count_presses, watch_wire(wired, handler)] if wired is not None else [count_presses],
        page=shown,
        recorder=recorder,
        watch=watch,
        lead=lead,
        correction=correction,
    )
    if host.terminal:
        children.restore_tty = opening.enter_context(kept_tty())
        prompt = child_process("motiondeck.run.terminal", str(port))
        children.add("the prompt", opening.enter_context(prompt))
    return session


def _servers(opening: ExitStack, spec: RunSpec) -> list[CommandServer]:
    """The sockets where commands are taken, the local one last; SocketError if a port or address cannot be used."""
    servers, port = list[CommandServer](), spec.command_port
    # A network knows which ports are free; the local socket then has the same number.
    if spec.listen is not None and spec.token_file is not None:
        from controller.wire.authentication import read_token

        server = CommandServer(port, spec.listen, read_token(Path(spec.token_file)))
        servers.append(opening.enter_context(closing(server)))
        port = server.port
    return [*servers, opening.enter_context(closing(CommandServer(port)))]


def _stop_sources(
    opening: ExitStack, spec: RunSpec, port: int, guard: GuardedRig | None
) -> tuple[Callable[[StopRequest], None], WiredStop | None]:
    """What counts the presses at the stop door, and the wired stop if there is one; a guard has them both itself."""
    if guard is not None:
        guard.watch_stops(port, str(spec.stop_input) if spec.stop_input is not None else None)
        return lambda stop: stop.state.count(STOP_DOOR, guard.door_presses), guard.wire
    door, wired = opening.enter_context(closing(StopDoor(port))), None
    if spec.stop_input is not None:
        from hardware.tools.stop_input import open_stop_input

        wired = opening.enter_context(closing(open_stop_input(Path(spec.stop_input))))
    return lambda stop: stop.state.count(STOP_DOOR, stop.state.presses.get(STOP_DOOR, 0) + door.poll()), wired


def _layers(library: MotionLibrary, robots: list[RobotOnDeck]) -> Layers:
    """The layers over what robots play of a library, by the names of all their joints."""
    return Layers(
        library,
        [joint for robot in robots for joint in robot.joints],
        all_limits([robot.limits for robot in robots]),
        {r.prefix + name: [r.prefix + one for one in group] for r in robots for name, group in r.groups.items()},
        lambda: together([robot.simulation.robot.twin() for robot in robots]),
        {joint: why for robot in robots for joint, why in robot.without_layers.items()},
        {robot.prefix + joint: gains for robot in robots for joint, gains in robot.gaze.items()},
    )


def _servos(robot: RobotOnDeck) -> RigOutput | None:
    """The rig of a robot."""
    if robot.rig is None:
        return None
    from motiondeck.run.robots.rig_output import RigOutput

    return robot.rig.output if isinstance(robot.rig.output, RigOutput) else None


def _watch(spec: RunSpec, played: Played, first: RobotOnDeck, channel: Channel) -> Watch | None:
    if spec.recognizer is None and not spec.recognize:
        return None
    from motiondeck.run.recognition.watches import BodyWatch, RecognitionWatch

    if spec.recognizer is not None:
        # What recognizes takes longer to import than all that plays.
        from controller.learning.recognition.recognizer import load_recognizer

        return BodyWatch(load_recognizer(Path(spec.recognizer)), played.source.skeleton)
    if not isinstance(played.source, MotionLibrary):
        return None
    robot, stops = first.simulation.robot, spec.on_mismatch == "stop"
    retarget = deepcopy(robot.retarget)  # one that remembers a pose must not remember the last one learned
    measured = retarget, robot.joints, robot.layout.ball, first.limits, channel
    return RecognitionWatch(played.source, *measured, spec.rate, spec.mismatch_after, stop=stops)


def _recorder(
    opening: ExitStack, spec: RunSpec, played: Played, robot: RobotOnDeck, deck: PlayableDeck, watch: Watch | None
) -> TickRecorder | None:
    if spec.record is None:
        return None
    simulation = robot.simulation
    from motiondeck.run.beside.tick_recorder import recording

    description = {
        "library": played.name,
        "robot": robot.name,
        "rig": str(find_rig(spec.rig_named).resolve()) if spec.robot is None else "",
        "joints": list(robot.own_joints),
        "motions": list(deck.motions),
        "recognizable": list(watch.names) if watch is not None else [],
        "rate": spec.rate,
        "root": simulation.root,
        "balance": simulation.balance,
        "walk": simulation.walk,
    }
    return opening.enter_context(recording(Path(spec.record), description, spec.rate))
