"""`motiondeck rig`: tools for a servo rig, real or emulated."""

import json
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from typer import Argument, Option

from motiondeck.cli.common.options import JsonOption
from motiondeck.cli.rig import calibrate, emulate, identify, servos, teach
from motiondeck.cli.rig.shared import LineInput, PortOption, RigArgument, ended_by_sigterm, load, open_buses
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.words import counted

app = typer.Typer(help="Set up, check, identify, teach or emulate a rig of servos.", no_args_is_help=True)


def doctor(
    rig: RigArgument,
    port: PortOption = None,
    fix: Annotated[bool, Option("--fix", help="Set every register that differs, and the USB latency to 1 ms.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Check a rig without moving it; exit code 1 on a problem.

    It reports servos that are missing or of another model, registers that differ from what the rig needs, heat and
    voltage, and the rate that the wire allows. Before --fix changes a servo, its settings are saved in a new file.

    Example:  motiondeck rig doctor servo20 --port /dev/ttyUSB0
    """
    from controller.loop.safety.compiled_envelope import unfit
    from hardware.bus.servo_bus import Bus
    from hardware.tools.backup import ServoBackup, save_backups
    from hardware.tools.doctor import examine, fix_settings, look_elsewhere, shorten_latency
    from motiondeck_base.shipped import state_folder

    config = load(rig)
    reports, done, refused = [], [], []
    before = list[ServoBackup]()
    saved = state_folder() / "settings" / f"{Path(rig).stem}-{time.strftime('%Y%m%d-%H%M%S')}.json"

    def keep(backup: ServoBackup) -> None:
        before.append(backup)
        saved.parent.mkdir(parents=True, exist_ok=True)
        save_backups(before, saved)

    with open_buses(config, port) as parts:
        for part, bus in parts:
            if fix:
                fixed = fix_settings(part, bus, keep)
                done, refused = done + fixed.done, refused + fixed.refused
                print(shorten_latency(bus.port.name), file=sys.stderr)
            reports.append(examine(part, bus))
    for (part, _), report in zip(parts, reports, strict=True):
        report.problems.extend(look_elsewhere(part, report, lambda baud, port=report.port: Bus.open(port, baud)))
    ports = "".join(f" --port {name}" for name in port or ())
    if before:
        print(f"to undo what was set: motiondeck rig restore {rig} {saved}{ports}", file=sys.stderr)
    problems = sum(len(report.problems) for report in reports)
    if as_json:
        print(msgspec.json.encode(reports[0] if len(reports) == 1 else {"ports": reports}).decode())
        raise typer.Exit(int(problems > 0))
    for line in done:
        print(f"set: {line}")
    for report in reports:
        latency = "unknown" if report.latency_ms is None else f"{report.latency_ms} ms"
        print(f"{report.port} at {report.baud} baud, USB latency {latency}")
        for servo in report.servos:
            print(
                f"id {servo.id:>3}  {servo.name:<18} {servo.model:<12} fw {servo.firmware}  {servo.position:+.2f} rad  "
                f"{servo.temperature:.0f} degC  {servo.voltage:.1f} V  torque {'on' if servo.torque else 'off'}"
            )
        for line in report.actuators:
            print(line)
        print(f"the wire allows {report.possible_hz:.0f} Hz; the rig file wants {report.rate_hz:g} Hz")
        for problem in report.problems:
            print(f"problem: {problem}")
        for note in report.notes:
            print(f"note: {note}")
    for line in (*(f"not set: {line}" for line in refused), *(f"note: {line}" for line in unfit())):
        print(line)
    print("no problem found" if not problems else f"{problems} problem{'s' * (problems > 1)}")
    if not fix and any("--fix sets" in problem for report in reports for problem in report.problems):
        print(f"to set what differs: motiondeck rig doctor {rig}{ports} --fix")
    raise typer.Exit(int(problems > 0))


def monitor(
    rig: RigArgument,
    port: PortOption = None,
    seconds: Annotated[float, Option(metavar="SECONDS", help="Stop after so many seconds; 0 runs until Ctrl-C.")] = 0.0,
    as_json: Annotated[bool, Option("--json", help="Print one JSON object a second.")] = False,
) -> None:
    """Watch position, load, temperature and errors of every servo.

    Nothing moves. Voltages are shown too.

    Example:  motiondeck rig monitor servo20 --port /dev/pts/3
    """
    from hardware.tools.monitor import observe

    config = load(rig)
    end = time.monotonic() + seconds if seconds else float("inf")
    with ended_by_sigterm(), open_buses(config, port) as parts:
        try:
            for seen in zip(*(observe(part, bus, 1.0 / len(parts)) for part, bus in parts), strict=True):
                rows, hz = [row for part, _ in seen for row in part], min(hz for _, hz in seen)
                if as_json:
                    print(json.dumps({"hz": round(hz, 1), "joints": rows}), flush=True)
                else:
                    _draw(rows, hz)
                if time.monotonic() >= end:
                    return
        except KeyboardInterrupt:
            return


def stop(rig: RigArgument, port: PortOption = None, as_json: JsonOption = False) -> None:
    """Switch the torque of every servo off.

    The exit code is 1 if a servo did not confirm it. The port must be free: a rig that plays is stopped by Ctrl-C
    there, or from another terminal by `motiondeck send stop` (as Ctrl-C) or `motiondeck send estop` (brake and hold).
    If a program was killed, the servos' watchdogs have stopped them but left the torque on.

    Example:  motiondeck rig stop servo20
    """
    from hardware.bus.port import SerialPort
    from hardware.errors import SerialPortError
    from hardware.rig.supervision.board_rig import BAUD, ask
    from hardware.rig.switching.torque import switch_off

    config = load(rig)
    unconfirmed: list[str] = []
    remedy = "Cut the power."
    for part in config.on_ports(port or ()):
        # The servos on other ports are switched off even if one port is gone.
        try:
            if config.board and not port:
                with closing(SerialPort(config.board, BAUD)) as board:
                    unconfirmed += [] if ask(board, "off")[0] == "ok" else part.servos.names
                continue
            with open_buses(part, None) as buses:
                unconfirmed += [name for own, bus in buses for name in switch_off(own.servos, bus)]
        except SerialPortError as error:
            print(f"motiondeck: {error}", file=sys.stderr)
            unconfirmed += part.servos.names
            if "another program" in str(error):
                remedy = "If a rig plays there: Ctrl-C, `motiondeck send estop` or `send stop`; else cut the power."
    names = config.servos.names
    if as_json:
        print(json.dumps({"off": [name for name in names if name not in unconfirmed], "unconfirmed": unconfirmed}))
    else:
        print(f"torque off: {len(names) - len(unconfirmed)} of {len(names)} servos")
    if unconfirmed:
        print(f"motiondeck: not confirmed by {', '.join(unconfirmed)}. {remedy}", file=sys.stderr)
        raise typer.Exit(1)


def _draw(rows: list[dict[str, object]], hz: float) -> None:
    if sys.stdout.isatty():
        print("\x1b[H\x1b[2J", end="")
    print(f"{hz:.0f} Hz")
    for row in rows:
        print(
            f"id {row['id']:>3}  {row['name']:<18} {row['position']:+7.3f} rad  {row['velocity']:+6.2f} rad/s  "
            f"{row['current']:+6.2f} A  {row['temperature']:>4} degC  {row['voltage']:>5} V  {row['errors']}"
            if row["heard"]
            else f"id {row['id']:>3}  {row['name']:<18} does not answer"
        )
    sys.stdout.flush()


def backup(
    rig: RigArgument, out: Annotated[Path, Option(metavar="FILE", help="The file (JSON).")], port: PortOption = None
) -> None:
    """Save the control table of every servo.

    Nothing is moved or changed in the servos.

    Example:  motiondeck rig backup my-rig.toml --out servos.json
    """
    from hardware.tools.backup import back_up, save_backups
    from motiondeck_base.files import check_folder

    if out.exists():
        raise MotiondeckError(f"{out} exists already, perhaps with the settings from before: give another --out")
    check_folder(out)
    with ended_by_sigterm(), open_buses(load(rig), port) as parts:
        backups = [one for part, bus in parts for one in back_up(part, bus)]
    save_backups(backups, out)
    print(f"wrote {out}: {counted(len(backups), 'servo')}")


def restore(
    rig: RigArgument, file: Annotated[Path, Argument(metavar="FILE", help="A `rig backup`.")], port: PortOption = None
) -> None:
    """Write a backup into the servos.

    EEPROM registers are written, except IDs and baud rates. Torque must be off.

    Example:  motiondeck rig restore my-rig.toml servos.json
    """
    from hardware.tools.backup import load_backups
    from hardware.tools.backup import restore as write_back

    backups = load_backups(file)
    with ended_by_sigterm(), open_buses(load(rig), port) as parts:
        written = [line for part, bus in parts for line in write_back(part, backups, bus)]
    print("\n".join(written) if written else "nothing differs")


def turns(rig: RigArgument, port: PortOption = None) -> None:
    """Store in which turn of its horn each joint stands.

    That is for joints that go through several. A servo forgets its turn with its power; a rig keeps it on disk. Where
    that was lost, or a joint was moved meanwhile, it is stored anew here: the torque goes off, and you put each such
    joint near its angle 0.

    Example:  motiondeck rig turns my-rig.toml
    """
    from hardware.rig.turn_file import TurnFile
    from hardware.tools.loose_joints import loosen, store_turns

    config = load(rig)
    names = [config.names[index] for index in config.through_turns]
    if not names:
        raise MotiondeckError(f"no joint of {rig} goes through several turns: there is nothing to store")
    typed = LineInput()
    with ended_by_sigterm(), open_buses(config, port) as parts:
        typed.ask("The torque goes off: hold what would fall, then press Enter ")
        for part, bus in parts:
            loosen(part, bus)
        within = min(180.0 / config.joints[index].gear for index in config.through_turns)
        typed.ask(f"Put {', '.join(names)} at angle 0, by less than {within:.0f} degrees, then press Enter ")
        for part, bus in parts:
            for name, angle in store_turns(part, bus, TurnFile.of_port(part.port)).items():
                print(f"{name} stands at {angle:+.2f} rad")


_SET_UP = {"scan": servos.scan, "setup": servos.setup, "import": servos.import_calibration}
_SET_UP |= {"calibrate": calibrate.calibrate, "turns": turns, "doctor": doctor, "identify": identify.identify}
_PANELS = {
    "Set up": _SET_UP | {"backup": backup, "restore": restore},
    "Use": {"teach": teach.teach, "monitor": monitor, "stop": stop},
    "Without hardware": {"emulate": emulate.emulate},
}
for _panel, _commands in _PANELS.items():
    for _name, _command in _commands.items():
        app.command(_name, rich_help_panel=_panel)(_command)
