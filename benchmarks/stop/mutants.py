"""Breaks what stops a robot line by line; the tests of each room must notice.

The exit code is 1 if a breakage survives, or its line has changed.
"""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from benchmarks.command import run

ROOT = Path(__file__).parents[2]
HANGS = 300.0  # s after which tests count as failed
_KEPT_OUT = shutil.ignore_patterns(".git", ".venv", "__pycache__", ".hypothesis")


class Mutant(NamedTuple):
    """A file, the tests that must notice, a piece of text that stands in the file once, and what replaces it."""

    what: str
    file: str
    tests: str
    text: str
    instead: str


ENVELOPE, SAFETY = "controller/loop/safety/safety_envelope.py", "tests/controller/loop/safety"
BRAKING, PACE = "controller/loop/safety/braking.py", "controller/loop/safety/pace.py"
STATE, STATES = "controller/loop/stop_state.py", "tests/controller/loop/test_stop_state.py"
PHASES, LOOP = "controller/loop/run_phases.py", "tests/controller/loop/test_run_phases.py"
COMMANDS, HANDLER = "controller/loop/commands/commanded_run.py", "tests/controller/loop/commands"
DOOR, CONNECTION = "controller/wire/stop_door.py", "controller/wire/local_connection.py"
LOCAL, WIRE = "controller/wire/local_transport.py", "tests/controller/wire"
NETWORK, SIGNED = "controller/wire/network_transport.py", "controller/wire/authentication.py"
PAGE, PAGES = "motiondeck/page/web/private_page.py", "tests/motiondeck/page/web/test_private_page.py"
MEMBER, SHOWS = "motiondeck/shows/member.py", "tests/motiondeck/shows"
CONDUCTOR, STANDING = "motiondeck/shows/conductor.py", "tests/motiondeck/shows/test_standing_stop.py"
CONDUCTOR, STANDING = "motiondeck/shows/conductor.py", "tests/motiondeck/shows/test_standing_stop.py"
RIG, RIGS = "hardware/rig/supervision/pace.py", "tests/hardware/rig"
GUARD, GUARDS = "motiondeck/run/guard/guard.py", "tests/motiondeck/run/guard/test_guard_ticks.py"
PORT = "hardware/rig/driving/servo_port.py"
SWITCHING, SWITCHED = "hardware/rig/switching/", "tests/hardware/rig/switching/"
TORQUE, AUDIT, DRIVE = SWITCHING + "torque.py", SWITCHING + "audit.py", "hardware/emulator/servos/drive.py"
SCALE, SCALES = "hardware/rig/scale.py", "tests/hardware/rig/test_rig_scale.py"
TURNS, FEETECH = (
    "tests/hardware/rig/supervision/test_several_turns.py",
    "tests/hardware/rig/driving/test_feetech_rig.py",
)
LIMITED = "tests/hardware/rig/supervision/test_current_limit.py"
OWN, LOADED = SWITCHED + "test_own_settings.py", "tests/hardware/rig/supervision/test_loaded_joints.py"

MUTANTS = (
    Mutant(
        "guard: it follows a deck that brakes", GUARD, GUARDS,
        "        self._rests |= targets.braking\n",
        "",
    ),
    Mutant(
        "envelope: acceleration is let go late, upwards", ENVELOPE, SAFETY,
        "        high = min(high, held_back(v_max - v, j_max))",
        "        pass",
    ),
    Mutant(
        "envelope: acceleration is let go late, downwards", ENVELOPE, SAFETY,
        "        low = max(low, -held_back(v_max + v, j_max))",
        "        pass",
    ),
    Mutant(
        "envelope: a passing target lets acceleration go late", ENVELOPE, SAFETY,
        "passes = fast + 0.5 * (spare * spare) / j_max <= v_max",
        "passes = fast <= v_max",
    ),
    Mutant(
        "envelope: a passing target needs no room to stop", ENVELOPE, SAFETY,
        "if passes and (way <= room or longest_run(fast, size, a_max, j_max) <= room):",
        "if passes:",
    ),
    Mutant(
        "envelope: no acceleration limit of a passing target", ENVELOPE, SAFETY,
        " and -a_max <= direct <= a_max",
        "",
    ),
    Mutant(
        "envelope: NaN passes", ENVELOPE, SAFETY,
        "target if -_FINITE < target < _FINITE else last_goal",
        "target",
    ),
    Mutant(
        "envelope: no stop before a position limit", ENVELOPE, SAFETY,
        "    if p + v + chosen + rise <= top and",
        "    if p + v + chosen <= top and",
    ),
    Mutant(
        "braking: no acceleration limit", BRAKING, SAFETY,
        "a - j, -most), a + j, most)",
        "a - j), a + j)",
    ),
    Mutant(
        "braking: a jerk too many", BRAKING, SAFETY,
        "return copysign(size / n + 0.5 * j * (n - 1), v)",
        "return copysign(size / n + 0.5 * j * n, v)",
    ),
    Mutant(
        "pace: 20 periods at once", PACE, SAFETY,
        "BURST = 2.0",
        "BURST = 20.0",
    ),
    Mutant(
        "pace: ticks that nothing has earned", PACE, SAFETY,
        "LEAST = 0.75",
        "LEAST = 0.0",
    ),
    Mutant(
        "phases: an emergency stop plays on", PHASES, LOOP,
        '"emergency stop": lambda: _hold(source, envelope, stop)',
        '"emergency stop": lambda: _follow(source, channels, envelope, stop)',
    ),
    Mutant(
        "phases: a run that ends in an emergency stop goes home", PHASES, LOOP,
        "    while not stop.emergency:\n",
        "    while True:\n",
    ),
    Mutant(
        "phases: rest before the joints are", PHASES, LOOP,
        "if envelope.at_rest:\n            stop.state",
        "if True:\n            stop.state",
    ),
    Mutant(
        "state: a pulled wire is reset", STATE, STATES,
        "for source in sorted(self.pulled):",
        "for source in ():",
    ),
    Mutant(
        "state: an old report is a press", STATE, STATES,
        "if presses > self.presses.get(source, 0):",
        "if True:",
    ),
    Mutant(
        "state: a reset releases presses that it has not seen", STATE, STATES,
        "min(count, self.presses.get(source, 0))",
        "self.presses.get(source, 0)",
    ),
    Mutant(
        "state: a reset while the joints brake", STATE, STATES,
        'if self.phase == "braking":\n            raise',
        "if False:\n            raise",
    ),
    Mutant(
        "commands: any is carried out in an emergency stop", COMMANDS, HANDLER,
        "if stop.mode not in message.row.modes:",
        "if False:",
    ),
    Mutant(
        "commands: torque on in an emergency stop", COMMANDS, HANDLER,
        'if to == "on":',
        "if False:",
    ),
    Mutant(
        "commands: a reset from elsewhere without its code", COMMANDS, HANDLER,
        "if not self._code or message.code != self._code:",
        "if False:",
    ),
    Mutant(
        "commands: a pressed stop keeps a code", COMMANDS, HANDLER,
        "        self._code = 0.0\n        self.deck.pause()",
        "        self.deck.pause()",
    ),
    Mutant(
        "signature: any is taken", SIGNED, WIRE,
        "return data if hmac.compare_digest(",
        "return data if True or hmac.compare_digest(",
    ),
    Mutant(
        "token: others may read it", SIGNED, WIRE,
        " or about.st_mode & 0o077",
        "",
    ),
    Mutant(
        "socket: other users may enter its folder", LOCAL, WIRE,
        " or about.st_mode & 0o077",
        "",
    ),
    Mutant(
        "socket: the group may enter its folder", LOCAL, WIRE,
        "about.st_mode & 0o077:",
        "about.st_mode & 0o007:",
    ),
    Mutant(
        "socket: any user is taken", LOCAL, WIRE,
        "if user in (0, os.geteuid()):",
        "if True:",
    ),
    Mutant(
        "page: any user is taken", PAGE, PAGES,
        "if not _is_same_user(connection):",
        "if False:",
    ),
    Mutant(
        "page: any name is taken", PAGE, PAGES,
        "not in [[host] for host in hosts]:",
        "in []:",
    ),
    Mutant(
        "page: any site's websockets are taken", PAGE, PAGES,
        "origins=pages, ",
        "",
    ),
    Mutant(
        "member: a stop of the show does not reach the deck", MEMBER, SHOWS,
        "        self._stop_deck(stop)\n",
        "",
    ),
    Mutant(
        "member: a stop is not passed on", MEMBER, SHOWS,
        'stop.by}")\n        self._link.publish("stop", messages.encode(stop))\n',
        'stop.by}")\n',
    ),
    Mutant(
        "member: a stop that stands is not repeated", MEMBER, STANDING,
        '        for stop in self._held:\n            self._link.publish("stop", messages.encode(stop))\n',
        "",
    ),
    Mutant(
        "member: a stop is forgotten when another comes", MEMBER, STANDING,
        "self._held = stops[-MOST_SENT:]",
        "self._held = stops[-1:]",
    ),
    Mutant(
        "member: a second press is swallowed", MEMBER, STANDING,
        "if others <= self._passed_on:",
        "if others <= self._passed_on or self._held:",
    ),
    Mutant(
        "member: presses of the show are taken for the deck's", MEMBER, STANDING,
        "self._own_presses += 1",
        "pass",
    ),
    Mutant(
        "member: a restarted deck does not wait", MEMBER, STANDING,
        "if now < self._joined_at:",
        "if False:",
    ),
    Mutant(
        "member: a restarted deck remembers nothing", MEMBER, STANDING,
        "for stop in memory.read() if memory is not None else ():",
        "for stop in ():",
    ),
    Mutant(
        "member: a deck goes on before a new conductor knows", MEMBER, STANDING,
        "if self._holds and received >= self._resumes_at:",
        "if self._holds:",
    ),
    Mutant(
        "member: a stop counts as carried out when it is sent", MEMBER, STANDING,
        " if stop not in self._stopping.values()]",
        "]",
    ),
    Mutant(
        "conductor: no stops in its clock's answers", CONDUCTOR, STANDING,
        "*lost, self._stops.latest)",
        "*lost, [])",
    ),
    Mutant(
        "conductor: stops of before are not taken over", CONDUCTOR, STANDING,
        "for stop in health.stops:",
        "for stop in ():",
    ),
    Mutant(
        "conductor: a deck that is not reached is not reported", CONDUCTOR, STANDING,
        'if name not in here or self.stop_at(self.decks[name]) == "not reached"]',
        "if name not in here]",
    ),
    Mutant(
        "member: a cue says anything", MEMBER, SHOWS,
        '                command.row.check_use("cue")\n',
        "",
    ),
    Mutant(
        "member: a cue says impossible numbers", MEMBER, SHOWS,
        "                command.check()\n",
        "",
    ),
    Mutant(
        "rig: a goal goes as far as it likes", RIG, RIGS,
        "bounded = np.minimum(np.maximum(within, goals - reach), goals + reach)",
        "bounded = within",
    ),
    Mutant(
        "rig: goals beyond the limits", RIG, RIGS,
        "within = self._scale.within(targets)\n        speed",
        "within = targets\n        speed",
    ),
    Mutant(
        "rig: watchdogs are not armed again", PORT, RIGS,
        "if not self._armed or now >= self._arm_next:",
        "if not self._armed:",
    ),
    Mutant(
        "rig: goals after a silence", PORT, RIGS,
        "return self._stopped or (self._armed and",
        "return self._stopped or (False and",
    ),
    Mutant(
        "network: a command is taken twice", NETWORK, WIRE,
        "or number <= self._last.get(name, self._floor):",
        "or False:",
    ),
    Mutant(
        "network: a command of another run is taken", NETWORK, WIRE,
        "if not hmac.compare_digest(challenge, self._expected(name)) or",
        "if",
    ),
    Mutant(
        "door: anything is a press", DOOR, WIRE,
        "encode(Refused(_REFUSAL, number_in(data))))\n            return 0",
        "encode(Refused(_REFUSAL, number_in(data))))\n            return 1",
    ),
    Mutant(
        "door: idle programs keep their places", DOOR, WIRE,
        "if len(self._holders) > PLACES else 0",
        "if False else 0",
    ),
    Mutant(
        "door: a program that has to leave is not heard", DOOR, WIRE,
        "while data := read_datagram(holder.connection, MOST_BYTES + 1):",
        'while data := b"":',
    ),
    Mutant(
        "door: so many come at once that none can send", DOOR, WIRE,
        "while admitted < PLACES and",
        "while",
    ),
    Mutant(
        "door: a stop that is sent again is another press", DOOR, WIRE,
        "if press.id and press.id in holder.presses:",
        "if False:",
    ),
    Mutant(
        "client: no stop where there is no door", CONNECTION, WIRE,
        "            self._awaited = 0\n            self._commands.send(data, patience)",
        "            raise",
    ),
    Mutant(
        "client: the stop waits for as long as a command", "controller/wire/command_socket.py", WIRE,
        "timeout_s = min(timeout_s, _STOPPED_WITHIN)",
        "pass",
    ),
    Mutant(
        "loop: no stop while commands keep failing", "controller/loop/loop.py", "tests/controller/loop/test_loop.py",
        "                    counter.call(source_of_stops, stop)",
        "                    if not commanding.faults:\n                        counter.call(source_of_stops, stop)",
    ),
    Mutant(
        "heartbeat: a silent client is not missed", "controller/loop/commands/listeners.py", HANDLER,
        "silent > listener.within):",
        "False):",
    ),
    Mutant(
        "heartbeat: a client that was held up hears no more", "controller/loop/commands/listeners.py", HANDLER,
        "            if gone or (listener",
        "            if gone or listener.missed or (listener",
    ),
    Mutant(
        "start again: after an emergency stop too", "motiondeck/cli/play.py", "tests/motiondeck/run/test_play_again.py",
        "if session.stop.emergency:",
        "if False:",
    ),
    Mutant(
        "guard: targets are followed however late they are", GUARD, GUARDS,
        "(self._missed > MISSED and not self._is_on_its_way)",
        "False",
    ),
    Mutant(
        "guard: joints that were held up stay behind the last targets", GUARD, GUARDS,
        "(self._missed > MISSED and not self._is_on_its_way)",
        "self._missed > MISSED",
    ),
    Mutant(
        "guard: targets after a gap count as a tick apart", GUARD, GUARDS,
        "if self._missed:\n",
        "if False:\n",
    ),
    Mutant(
        "guard: ticks that it has lost are lost for the joints", GUARD, GUARDS,
        "self._make_up(lost)",
        "pass",
    ),
    Mutant(
        "guard: targets sent long ago are fresh", GUARD, GUARDS,
        "fresh = fresh and now - self._targets.sent < MISSED * self._period",
        "pass",
    ),
    Mutant(
        "guard: held joints jump to targets elsewhere", GUARD, GUARDS,
        " and np.all(np.abs(last - envelope.position) < AT):",
        ":",
    ),
    Mutant(
        "guard: a lost deck does not stop the rig", GUARD, GUARDS,
        "self.stop.pull(DECK, True)",
        "pass",
    ),
    Mutant(
        "guard: the wired stop is not watched", GUARD, GUARDS,
        "self.stop.watch(self.wired)",
        "pass",
    ),
    Mutant(
        "guard: presses at its door are not counted", GUARD, GUARDS,
        "self.stop.press(STOP_DOOR)",
        "pass",
    ),
    Mutant(
        "guard: a reset at the deck releases all presses at the door", GUARD, GUARDS,
        "stop.release({STOP_DOOR: door, DECK",
        "stop.release({STOP_DOOR: 10**9, DECK",
    ),
    Mutant(
        "guard: a stop at the deck does not reach it", GUARD, GUARDS,
        "stop.pull(DECK, targets.stopped)",
        "pass",
    ),
    Mutant(
        "actuator: a current has no direction", SCALE, SCALES,
        "[joint.direction * _ampere(joint) for joint in joints]",
        "[_ampere(joint) for joint in joints]",
    ),
    Mutant(
        "actuator: torque that is not taken is swallowed", TORQUE, SWITCHED + "test_torque_is_taken.py",
        'raise RigError(f"{list_joints(config.only(off).joints)} did not take torque on. Try again.")',
        "pass",
    ),
    Mutant(
        "actuator: goal := present of a servo that kept its torque", TORQUE, LOADED,
        "np.where(moves | stands,",
        "np.where(moves,",
    ),
    Mutant(
        "actuator: gains are overwritten", AUDIT, OWN,
        'yield name, default, "kept"',
        'yield name, default, "switch-on"',
    ),
    Mutant(
        "actuator: the temperature limit is the table's", "hardware/rig/state_block.py", OWN,
        'read_each(config, bus, "temperature_limit")',
        "[joint.hottest for joint in config.joints]",
    ),
    Mutant(
        "actuator: the limit of current is written in mode 3", "hardware/rig/rig_joint.py", LIMITED,
        "return plain if not self.current or plain in limited else limited[0]",
        "return plain",
    ),
    Mutant(
        "actuator: a change of mode takes the limit of current away", AUDIT, LIMITED,
        '(*joint.gains, "goal_current")',
        "joint.gains",
    ),
    Mutant(
        "actuator: the stored turn is ignored", SWITCHING + "turns.py", TURNS,
        "return turn.zero + moved",
        "return turn.zero",
    ),
    Mutant(
        "actuator: an echo is not skipped", "hardware/bus/port.py", "tests/hardware/bus/test_echo.py",
        "return received[echo:]",
        "return received",
    ),
    Mutant(
        "actuator: the sign bit of a speed is not read", SCALE, SCALES,
        "return np.where(counts & sign, -size, size)",
        "return size",
    ),
    Mutant(
        "actuator: an EEPROM lock is not opened", "hardware/rig/registers.py", FEETECH,
        "bus.write(id, lock.address, lock.encode(0))",
        "pass",
    ),
    Mutant(
        "actuator: the lag is applied twice", "controller/loop/lead.py", "tests/controller/loop/test_lead.py",
        "(Delay(self._largest - lag, dt),",
        "(Delay(self._largest - 2.0 * lag, dt),",
    ),
    Mutant(
        "actuator: a correction is learned while a joint yields", "controller/loop/correction.py",
        "tests/controller/loop/test_correction.py",
        "doubted = ~(free & (np.abs(error) < TOO_FAR))",
        "doubted = ~(np.abs(error) < TOO_FAR)",
    ),
    Mutant(
        "actuator: a supply does not drive a current", DRIVE, "tests/hardware/emulator/servos",
        "self.current = (drive / full * powered -",
        "self.current = (drive / full -",
    ),
    Mutant(
        "actuator: a register is written that nothing asked for", AUDIT, "tests/hardware/rig/test_many_models.py",
        'yield "min_position_limit", low, "switch-on"',
        'yield "min_position_limit", low, "switch-on"\n        yield "return_delay_time", 0, "switch-on"',
    ),
)  # fmt: skip


def passes(copy: Path, tests: str) -> bool:
    """Whether tests pass in a copy of the project."""
    command = [sys.executable, "-m", "pytest", "-n", "0", "-x", "-q", tests]
    environment = os.environ | {"PYTHONPATH": str(copy)}
    try:
        return subprocess.run(command, cwd=copy, env=environment, capture_output=True, timeout=HANGS).returncode == 0
    except subprocess.TimeoutExpired:
        return False


@functools.cache
def sound(copy: Path, tests: str) -> bool:
    """Whether tests pass in a copy of the project that is whole; asked once."""
    return passes(copy, tests)


def noticed(mutant: Mutant, copy: Path) -> bool:
    """Whether the tests fail with the breakage in a copy of the project, which is whole again afterwards.

    Raises:
        ValueError: if the file no longer has the text once, or the tests fail without the breakage.
    """
    file = copy / mutant.file
    whole = file.read_text()
    if whole.count(mutant.text) != 1:
        raise ValueError(f"{mutant.file} has '{mutant.text}' {whole.count(mutant.text)} times")
    if not sound(copy, mutant.tests):
        raise ValueError(f"{mutant.tests} fails without it")
    file.write_text(whole.replace(mutant.text, mutant.instead))
    try:
        return not passes(copy, mutant.tests)
    finally:
        file.write_text(whole)


def main(
    only: Annotated[str, typer.Option("--only", help="Those whose name has this in it.")] = "",
) -> None:
    survived = 0
    chosen = [mutant for mutant in MUTANTS if only in mutant.what]
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "project"
        shutil.copytree(ROOT, copy, ignore=_KEPT_OUT, symlinks=True)
        for mutant in chosen:
            began = time.monotonic()
            try:
                verdict = "noticed" if noticed(mutant, copy) else "SURVIVED"
            except ValueError as error:
                verdict = f"CHANGED: {error}"
            survived += verdict != "noticed"
            print(f"{verdict:<9} {time.monotonic() - began:5.0f} s  {mutant.what}", flush=True)
    print(f"{len(chosen) - survived} of {len(chosen)} noticed")
    raise typer.Exit(1 if survived else 0)


if __name__ == "__main__":
    run("mutants", main, __doc__)
