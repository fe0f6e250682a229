"""`motiondeck rig`: the tools of a servo rig, on real hardware or on the emulator."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from controller.cli.rig import play, settings, teach
from controller.cli.rig.rig_port import JsonOption, PortOption, RigArgument, ended_by_sigterm, load, open_buses
from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from hardware.emulator.plant import JointPlant
    from hardware.rig.rig_file import RigConfig

app = typer.Typer(
    help="Find, check, set up, watch, teach and play the servos of a rig; or emulate one.", no_args_is_help=True
)

app.command("teach")(teach.teach)
app.command("play")(play.play)
app.command("backup")(settings.backup)
app.command("restore")(settings.restore)


@app.command("emulate")
def emulate(
    rig: RigArgument,
    fault: Annotated[
        list[str] | None, typer.Option("--fault", help="KIND[:key=value,...]; `--fault help` lists them.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="Of the random faults.")] = 0,
    unpaced: Annotated[bool, typer.Option("--unpaced", help="Bytes take no time on the wire.")] = False,
    lenient: Annotated[
        bool, typer.Option("--lenient", help="In a sync read, servos behind a silent one answer anyway.")
    ] = False,
    link: Annotated[
        Path | None,
        typer.Option("--link", help="A link to the port; it stays when the adapter is replugged."),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option("--robot", help="The body that the servos turn: a robot file, or a shipped one."),
    ] = None,
    root: Annotated[
        str | None, typer.Option("--root", help="With --robot: fixed in the air (default), or free to fall.")
    ] = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Only the first servo, as it comes from the box: id 1, 57600 baud.")
    ] = False,
) -> None:
    """Emulate a rig: print the port to open, and serve any client until Ctrl-C.

    With --robot the servos turn a body with masses, so they feel load, stall and fall: as current, heat and sag.

    [bold]Examples[/]

      motiondeck rig emulate servo20 --fault dead:id=3,at=5,for=1

      motiondeck rig emulate servo20 --robot servo20 --root free
    """
    from hardware.emulator.faults import KINDS, parse_fault
    from hardware.emulator.pty_server import serve

    if fault and "help" in fault:
        for kind, meaning in KINDS.items():
            print(f"{kind:<10} {meaning}")
        print("keys: id, at (s), for (s), chance (0 to 1), value")
        return
    if root is not None and robot is None:
        raise MotiondeckError(f"--root {root} is about a body: name it with --robot")
    config = load(rig)
    if fresh:
        import msgspec

        one = msgspec.structs.replace(config.joints[0], id=1)
        config = msgspec.structs.replace(config, joints=(one,), baud=57600)
    plant = _plant(config, robot, root or "fixed") if robot is not None else None
    faults = [parse_fault(text) for text in fault or []]
    with ended_by_sigterm():
        serve(config, lambda port: print(port, flush=True), faults, not unpaced, not lenient, link, seed, plant)


@app.command("scan")
def scan(
    port: Annotated[str, typer.Argument(metavar="PORT", help="The serial port.")] = "/dev/ttyUSB0",
    baud: Annotated[list[int] | None, typer.Option("--baud", help="Only these baud rates.")] = None,
    as_json: JsonOption = False,
) -> None:
    """List every servo that answers on a port, at any baud rate.

    Example:  motiondeck rig scan /dev/ttyUSB0
    """
    from hardware.bus.servo_bus import Bus
    from hardware.rig.rig_file import BAUD_RATES
    from hardware.tools.doctor import scan as scan_port

    wrong = [rate for rate in baud or [] if rate not in BAUD_RATES]
    if wrong:
        raise MotiondeckError(f"baud {wrong[0]} is not one of {', '.join(map(str, BAUD_RATES))}")
    found = scan_port(lambda rate: Bus.open(port, rate), *([baud] if baud else []))
    if as_json:
        rows = [
            {"baud": one.baud, "id": i.id, "model": i.model, "firmware": i.firmware, "alert": i.alert}
            for one in found
            for i in (one.identity,)
        ]
        print(json.dumps({"port": port, "servos": rows}))
        return
    for one in found:
        who = one.identity
        alert = "  reports a hardware problem" if who.alert else ""
        print(f"id {who.id:>3}  {who.model:<14} firmware {who.firmware:<3} {one.baud} baud{alert}")
    if not found:
        raise MotiondeckError(f"no servo answers on {port}. Check power, cable and adapter.")


@app.command("doctor")
def doctor(
    rig: RigArgument,
    port: PortOption = None,
    fix: Annotated[
        bool,
        typer.Option("--fix", help="Set every register that differs, and the USB adapter's latency timer to 1 ms."),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Check a rig without moving it; exit code 1 on a problem.

    Shown are servos that are missing or of another model, registers that differ from what the rig needs, heat and
    voltage, and how fast the wire can be.

    Example:  motiondeck rig doctor configs/rigs/servo20.toml --port /dev/ttyUSB0
    """
    import msgspec

    from hardware.tools.doctor import examine, fix_settings, shorten_latency

    config = load(rig)
    reports, refused = [], []
    with open_buses(config, port) as parts:
        for part, bus in parts:
            if fix:
                refused += fix_settings(part, bus)
                print(shorten_latency(bus.port.name), file=sys.stderr)
            reports.append(examine(part, bus))
    if as_json:
        print(msgspec.json.encode(reports[0] if len(reports) == 1 else {"ports": reports}).decode())
    for report in reports if not as_json else []:
        print(f"{report.port} at {report.baud} baud, USB latency {report.latency_ms or 'unknown'} ms")
        for servo in report.servos:
            print(
                f"id {servo.id:>3}  {servo.name:<18} {servo.model:<12} fw {servo.firmware}  {servo.position:+.2f} rad  "
                f"{servo.temperature:.0f} degC  {servo.voltage:.1f} V  torque {'on' if servo.torque else 'off'}"
            )
        print(f"the wire allows {report.possible_hz:.0f} Hz; the rig file wants {report.rate_hz:g} Hz")
        for problem in report.problems:
            print(f"problem: {problem}")
    problems = sum(len(report.problems) for report in reports)
    if not as_json:
        if refused:
            print("\n".join(f"not set: {line}" for line in refused))
        print("no problem found" if not problems else f"{problems} problems")
    if problems:
        raise typer.Exit(1)


@app.command("setup")
def setup(
    port: Annotated[str, typer.Argument(metavar="PORT", help="The serial port with one servo on it.")],
    id: Annotated[int, typer.Option("--id", min=0, max=252, help="The ID it gets.")],
    baud: Annotated[int, typer.Option("--baud", help="The baud rate it gets.")] = 1_000_000,
    as_json: JsonOption = False,
) -> None:
    """Give the only servo on a port its ID and baud rate.

    Example:  motiondeck rig setup /dev/ttyUSB0 --id 7 --baud 4000000
    """
    from hardware.bus.port import lasting_name
    from hardware.bus.servo_bus import Bus
    from hardware.rig.rig_file import BAUD_RATES
    from hardware.tools.doctor import set_up

    if baud not in BAUD_RATES:
        raise MotiondeckError(f"baud {baud} is not one of {', '.join(map(str, BAUD_RATES))}")
    before, after = set_up(lambda rate: Bus.open(port, rate), id, baud)
    if as_json:
        print(
            json.dumps({"model": after.model, "id": after.id, "baud": baud, "was": [before.identity.id, before.baud]})
        )
        return
    was = f"id {before.identity.id} at {before.baud} baud"
    print(f"{after.model}: {was} is now id {after.id} at {baud} baud, return delay 0")
    if (lasting := lasting_name(port)) != port:
        print(f'write port = "{lasting}" into the rig file: the adapter keeps this name when it is plugged in again')


@app.command("monitor")
def monitor(
    rig: RigArgument,
    port: PortOption = None,
    seconds: Annotated[float, typer.Option("--seconds", help="Stop after so many seconds; 0 runs until Ctrl-C.")] = 0.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object a second.")] = False,
) -> None:
    """Watch position, load, temperature, voltage and errors of every servo, live; moves nothing.

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


@app.command("calibrate")
def calibrate(
    rig: RigArgument,
    out: Annotated[Path, typer.Option("--out", help="The rig file to write.")],
    port: PortOption = None,
) -> None:
    """Find each joint's zero, direction and range by moving it by hand, torque off, and write a new rig file.

    Example:  motiondeck rig calibrate servo20 --out my-rig.toml
    """
    import threading

    import msgspec

    from hardware.tools.calibration import calibrate as guide
    from hardware.tools.calibration import save_rig

    def ask(what: str) -> None:
        try:
            input(f"{what}, then press Enter ")
        except EOFError:
            raise MotiondeckError("calibrating needs a terminal in which to press Enter") from None

    def sweep(what: str, read: Callable[[], int]) -> list[int]:
        done = threading.Event()

        def wait() -> None:
            try:
                ask(what)
            finally:
                done.set()

        threading.Thread(target=wait, daemon=True).start()
        seen = [read()]
        while not done.wait(0.02):
            seen.append(read())
        return seen

    config = load(rig)
    with ended_by_sigterm(), open_buses(config, port) as parts:
        found = {joint.name: joint for part, bus in parts for joint in guide(part, bus, ask, sweep).joints}
        joints = tuple(msgspec.structs.replace(found[joint.name], port=joint.port) for joint in config.joints)
        save_rig(msgspec.structs.replace(config, joints=joints), out)
    print(f"wrote {out}")


@app.command("stop")
def stop(rig: RigArgument, port: PortOption = None, as_json: JsonOption = False) -> None:
    """Take the torque off every servo of a rig, now; exit 1 if one did not confirm it.

    Only while no other program has the port. A rig that plays is stopped by Ctrl-C there, or from another
    terminal by `motiondeck send stop` (as Ctrl-C) or `motiondeck send estop` (brake and hold).

    After a program was killed, the servos' watchdogs stop them but leave torque on: this takes it off.

    Example:  motiondeck rig stop servo20
    """
    from hardware.errors import SerialPortError
    from hardware.rig.joined_rig import on_ports
    from hardware.rig.switching import switch_off

    config = load(rig)
    unconfirmed: list[str] = []
    remedy = "Cut the power."
    for part in on_ports(config, port or ()):
        # One port that is gone must not keep the others from being switched off.
        try:
            with open_buses(part, None) as buses:
                unconfirmed += [name for own, bus in buses for name in switch_off(own, bus)]
        except SerialPortError as error:
            print(f"motiondeck: {error}", file=sys.stderr)
            unconfirmed += part.names
            if "another program" in str(error):
                remedy = (
                    "If a rig is playing there: Ctrl-C, `motiondeck send estop` or `send stop`; else cut the power."
                )
    if as_json:
        print(
            json.dumps({"off": [name for name in config.names if name not in unconfirmed], "unconfirmed": unconfirmed})
        )
    else:
        print(f"torque off: {len(config.names) - len(unconfirmed)} of {len(config.names)} servos")
    if unconfirmed:
        print(f"motiondeck: not confirmed by {', '.join(unconfirmed)}. {remedy}", file=sys.stderr)
        raise typer.Exit(1)


def _plant(config: RigConfig, robot: str, root: str) -> JointPlant:
    """A robot's body for the joints of a rig."""
    from controller.mocap.encodings.joint_angles import JointBody
    from motiondeck_base.shipped import find_robot
    from sim.physics.rig_plant import RigPlant
    from sim.robots.robot import load_robot

    body = load_robot(find_robot(robot), JointBody.of(config.names))
    return RigPlant(body, config.names, root)


def _draw(rows: list[dict[str, object]], hz: float) -> None:
    """Prints the table; on a terminal it replaces the previous one."""
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
