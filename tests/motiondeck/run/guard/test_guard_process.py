"""The guard as a process, with emulated servos behind it: it connects, answers, closes, and outlives its deck."""

import signal
import time
from contextlib import ExitStack, closing, contextmanager

import numpy as np
import pytest

from controller.deck.interfaces import JointLimits
from controller.loop.stop_state import STOP_DOOR
from controller.wire.command_socket import CommandClient
from controller.wire.messages.commands import EmergencyStop
from controller.wire.messages.replies import Accepted, Refused
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.scale import RigScale
from motiondeck.run.guard import guarded_rig
from motiondeck.run.guard.guarded_rig import connect, guard_process
from served_rigs import served
from waiting import PATIENCE, until

NAMES = ("pan", "tilt")
CONFIG = RigConfig(
    port="/dev/nowhere",
    baud=1_000_000,
    rate_hz=50.0,
    joints=tuple(RigJoint(name, 1 + n, "XM430-W350", 1, 2048, -1.5, 1.5, 4.0) for n, name in enumerate(NAMES)),
)
LIMITS = JointLimits(*(np.full(2, x) for x in (-1.5, 1.5, 4.0, 40.0, 2000.0)))
T = 1.0 / CONFIG.rate_hz


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """The guard is a process that may wait for a core."""
    for limit in ("_REPORTS_WITHIN", "_WATCHES_WITHIN", "_CLOSES_WITHIN"):
        monkeypatch.setattr(guarded_rig, limit, PATIENCE)


@contextmanager
def guard_of(port):
    """The link to a guard, its process and its rig; servos that get no core while it connects are asked anew."""
    with ExitStack() as opened:

        def connected():
            link, process = opened.enter_context(guard_process())
            try:
                return link, process, connect(link, process, CONFIG, LIMITS, (0, 1), [port], None)
            except RigError as error:
                if "does not answer" not in str(error):
                    raise
                return None

        yield until(connected, "the rig")


@contextmanager
def guarded(port):
    with guard_of(port) as (_, _, rig):
        yield rig


def play(rig, seconds, speed=2.0, joint=0):
    """The deck's side: it comes to where joints are held, and from there one of them moves on, rad/s."""
    until(lambda: rig.collect_state() or rig.held is not None, "the guard")
    targets = rig.states.goals.copy()
    for _ in range(round(seconds / T)):
        rig.collect_state()
        if rig.held is not None:
            targets[:] = rig.held
        rig.write(targets)
        targets[joint] += speed * T
        time.sleep(T)


def wait(rig, done, what):
    """Holds the joints until something is done."""
    until(lambda: play(rig, 0.06, speed=0.0) or done(), what)


def angles(servos):
    return RigScale(CONFIG).angles(np.array([servos[1 + n]["goal_position"] for n in range(2)]))


def test_targets_reach_the_servos_and_their_state_comes_back():
    with served(CONFIG) as (servos, port), guarded(port) as rig:
        until(lambda: play(rig, 0.1) or rig.positions[0] > 0.3, "the way")
        wait(rig, lambda: angles(servos)[0] == pytest.approx(rig.states.goals[0], abs=0.01), "the end of the way")
        assert rig.states.torque.all()
        assert rig.states.temperatures[0] > 20.0
        assert rig.report.write_us["p50"] > 0.0
        assert rig.close() == []
        assert not servos[1]["torque_enable"]
        assert rig.close() == []


def test_a_rig_that_cannot_be_connected_says_why():
    with pytest.raises(RigError, match="no such device"), guarded("/dev/nowhere"):
        pass


def test_a_deck_that_is_gone_leaves_its_joints_at_rest_with_torque_on(capfd):
    with served(CONFIG) as (servos, port):
        with guard_of(port) as (link, process, rig):
            play(rig, 0.5)
            link.close()  # as when the deck is killed
            process.wait()
        held = angles(servos)
        assert servos[1]["torque_enable"]
        assert not servos[1]["bus_watchdog"]
        time.sleep(0.2)
        np.testing.assert_array_equal(angles(servos), held)
    assert "The joints hold, with torque on" in capfd.readouterr().err


@pytest.mark.thorough
def test_a_guard_that_is_to_end_brakes_first_and_its_deck_reads_that_it_is_gone():
    with served(CONFIG) as (servos, port):
        with guard_of(port) as (_, process, rig):
            play(rig, 0.5)
            process.send_signal(signal.SIGTERM)
            with pytest.raises(RigError, match="guard of the rig has ended"):
                play(rig, PATIENCE)
        assert servos[1]["torque_enable"]


def test_the_door_stops_the_rig_without_its_deck():
    with served(CONFIG) as (_, port), guarded(port) as rig:
        rig.watch_stops(49001, None)
        play(rig, 0.4)
        with closing(CommandClient(49001)) as client:
            assert isinstance(client.request(EmergencyStop()), Accepted)
        until(lambda: rig.collect_state() and rig.door_presses == 1, "the press")
        until(lambda: rig.collect_state() and rig.held is not None, "the end of braking")
        held = rig.held.copy()
        play(rig, 0.3)
        np.testing.assert_array_equal(rig.held, held)
        rig.stop.count(STOP_DOOR, 1)
        rig.stop.rested()
        rig.stop.reset()
        rig.stop.go_on()
        until(lambda: play(rig, 0.1) or (rig.held is None and rig.states.goals[0] > held[0] + 0.1), "the way on")


def test_a_wired_stop_that_cannot_be_opened_says_so():
    with served(CONFIG) as (_, port), guarded(port) as rig, pytest.raises(RigError, match="nothing: cannot be read"):
        rig.watch_stops(49002, "/dev/nothing")


def counts(registers):
    return {register.name: register.count for register in registers.registers}


def answer(rig, ask):
    """The answer to a question, which is refused until the rig knows of the torque what its servos know."""
    given = []

    def taken():
        given.append(ask())
        wait(rig, given[-1], "an answer")
        return not isinstance(given[-1](), Refused)

    until(taken, "an answer that is no refusal")
    return given[-1]()


def test_what_is_asked_of_servos_is_answered_beside_the_targets():
    with served(CONFIG) as (servos, port), guarded(port) as rig:
        play(rig, 0.2)
        reading, other = rig.ask(0), rig.ask(1, ("led", 1))
        wait(rig, lambda: reading() and other(), "the registers")
        assert counts(reading())["torque_enable"] == 1
        assert "while its torque is off" in other().reason
        rig.switch_off(1)
        wait(rig, lambda: not servos[2]["torque_enable"], "the torque that goes off")
        assert counts(answer(rig, lambda: rig.ask(1, ("led", 1))))["led"] == 1
        assert "was switched off on command" in [incident.what for incident in rig.incidents]
        rig.set_up_again(1)
        wait(rig, lambda: servos[2]["torque_enable"], "the torque")
        scan = answer(rig, rig.ask)
        assert [(servo.joint, servo.servo, servo.model) for servo in scan.servos] == [
            ("pan", 1, "XM430-W350"),
            ("tilt", 2, "XM430-W350"),
        ]
        assert scan.missing == []
