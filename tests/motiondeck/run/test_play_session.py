"""A whole session in this process: two robots from one run, and signals that come while it is still opening."""

import os
import signal
from contextlib import closing

import numpy as np
import pytest

import synthetic
from benchmarks.simulated_time import VirtualClock
from controller.deck.deck import Deck
from controller.loop.safety import compiled_envelope
from controller.loop.stop_requests import SIGNALS
from controller.motion.skeleton import Pose
from controller.wire.command_socket import CommandClient
from controller.wire.messages.commands import EmergencyStop, ServoTorque, Subscribe
from controller.wire.messages.replies import Accepted, Event
from motiondeck.run.assembly import open_session
from motiondeck.run.robots.robot_on_deck import open_robots
from motiondeck.run.session import Host, Played
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.shipped import find_rig
from shipped_libraries import shipped
from waiting import until

POSE = Pose(np.zeros(3), np.array(0.0), np.zeros((1, 4)))


@pytest.fixture(scope="module")
def library():
    return synthetic.small_library()


def session(library, deck, robots=1, **changes):
    """A run of mannequins at 100 Hz on a virtual clock."""
    follow = "mannequin" if robots == 2 else None
    spec = RunSpec(physics=False, follow=follow, rate=100.0, **{"seconds": 0.5} | changes)
    played = Played(library, lambda opening: open_robots(opening, spec, library), deck)
    return open_session(spec, played, Host(clock=VirtualClock(100.0)))


def test_an_emergency_stop_at_the_door_stops_pauses_and_is_told_to_subscribers(library):
    with (
        session(library, lambda retarget: Deck(library, retarget, "march")) as run,
        closing(CommandClient(run.command_port)) as client,
    ):
        client.post(Subscribe())
        number = client.post(EmergencyStop())
        run.run()
        replies = [client.receive(0.0) for _ in range(5)]
        assert replies[0] == Accepted(number)  # from the door
        kinds = [(reply.kind, reply.text) for reply in replies if isinstance(reply, Event)]
        assert kinds[:2] == [("mode", "emergency stop"), ("paused", "paused")]
        assert run.stop.mode == "emergency stop"
        assert run.deck.paused


@pytest.mark.parametrize("fits", [True, False])
def test_a_run_begins_with_a_line_if_its_envelope_is_slow_for_want_of_a_new_installation(
    library, fits, monkeypatch, tmp_path, capsys
):
    file = tmp_path / "envelope.so"
    monkeypatch.setattr(compiled_envelope, "COMPILED", file)
    if not fits:
        file.write_bytes(b"older")
    with session(library, lambda retarget: Deck(library, retarget, "march"), seconds=0.02) as run:
        run.run()
    assert ("pip install -e . compiles it anew\n" in capsys.readouterr().err) == (not fits)


def test_commands_that_raise_do_not_keep_the_door_from_working(library):
    with (
        session(library, lambda retarget: Deck(library, retarget, "march")) as run,
        closing(CommandClient(run.command_port)) as client,
    ):
        ticks = []

        class Broken:
            def __call__(self, stop):
                ticks.append(stop.mode)
                if len(ticks) == 2:
                    client.post(EmergencyStop())
                raise OSError("stderr is gone")

            def notify(self, *_):
                pass

        run.handler = Broken()
        report = run.run()
        assert ticks == ["playing"] * 2 + ["emergency stop"] * 3
        assert report["reason"] == "commands keep failing: OSError: stderr is gone"
        assert isinstance(client.receive(0.0), Accepted)


def test_a_second_robot_mirrors_the_first(library):
    with session(library, lambda retarget: Deck(library, retarget, "march"), robots=2) as run:
        first, second = (robot.simulation.stage for robot in run.robots)
        report = run.run()
    assert [output["name"] for output in report["outputs"]] == ["kinematics", "follower kinematics"]
    assert report["outputs"][0]["writes"] == report["outputs"][1]["writes"] == report["ticks"]
    assert first.qpos.tolist() == second.qpos.tolist()


def test_the_servos_of_a_robot_that_another_mirrors_take_commands():
    library, servos = shipped(), {"robot": "servo20", "rig": "emulated"}
    with session(library, lambda retarget: Deck(library, retarget, "walk"), robots=2, **servos) as run:
        joint = run.robots[0].own_joints[0]
        assert run.handler.carry_out(ServoTorque(joint, "off"), run.stop) == Accepted(0)
        output, still = run.channels[0].output, np.zeros(sum(len(robot.own_joints) for robot in run.robots))

        def incidents():
            output.write(still, POSE)
            return output.incidents

        until(lambda: f"{joint} (id 1) was switched off on command" in incidents(), "the incident")


def test_a_rig_whose_file_says_so_is_led_and_learns(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    library, file = shipped(), tmp_path / "lagging.toml"
    text = find_rig("servo20").read_text().replace("velocity = 4.7 }", "velocity = 4.7, lag = 0.052 }")
    file.write_text(text + "\n[follow]\nlearn = true\n")
    rig = {"robot": "servo20", "rig": f"emulated:{file}"}
    with session(library, lambda retarget: Deck(library, retarget, "waltz"), **rig) as run:
        assert run.deck.lead == pytest.approx(0.052, abs=run.clock.period)
        assert run.channels[0].output.correction is run.correction
        run.correction.tables["waltz", 0] = np.full((9, 20), 0.01)
    assert len([*tmp_path.rglob("thesis15-*.safetensors")]) == 1


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_while_the_run_is_opening_ends_it_before_anything_moves(library, number):
    def deck(retarget):
        os.kill(os.getpid(), number)
        return Deck(library, retarget, "march")

    before = signal.getsignal(number)
    with session(library, deck) as run:
        report = run.run()
    assert (report["reason"], report["ticks"]) == (SIGNALS[number], 0)
    assert report["outputs"][0]["writes"] == 0
    assert signal.getsignal(number) is before


def test_a_second_signal_while_opening_ends_it_at_once(library):
    def deck(retarget):
        os.kill(os.getpid(), signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGTERM)
        raise AssertionError("never reached")

    with pytest.raises(KeyboardInterrupt), session(library, deck):
        pass


def test_the_loop_gets_its_core_and_what_it_started_the_others(library):
    before = os.sched_getaffinity(0)
    core = min(before)

    def deck(retarget):
        assert os.sched_getaffinity(0) == (before - {core} or before)
        return Deck(library, retarget, "march")

    with session(library, deck, core=core, seconds=0.1) as run:
        report = run.run()
    assert report["permissions"] == {f"core {core} (CPU affinity)": True}
    assert os.sched_getaffinity(0) == before
