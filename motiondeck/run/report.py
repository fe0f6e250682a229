"""What a run reports: a progress line, events for overruns and faults, and at the end JSON or a few lines."""

import shutil
import sys
import threading
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, TextIO

import msgspec
import numpy as np

from controller.deck.switch import CommandedSwitch
from controller.loop.clock import Clock
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.interfaces import PlayableDeck
from controller.loop.commands.snapshots import RecognitionState
from controller.loop.loop import LoopReport
from controller.loop.output_channel import Channel
from controller.loop.permissions import Permission
from controller.loop.stop_requests import StopRequest
from controller.wire.command_socket import CommandServer
from controller.wire.messages.arguments import described
from motiondeck_base.words import counted

PERIOD = 0.25  # s from one progress line to the next
_MODES = {"home": "at home", "held": "held", "emergency stop": "EMERGENCY STOP"}


def words_of(deck: PlayableDeck, stop: StopRequest, seconds: float | None) -> str:
    """The progress line: what is played, for how long, and when or how it ends."""
    if stop:
        return f"{stop.reason}: the joints come to rest"
    if stop.mode != "playing":
        return f"{_MODES[stop.mode]}: {deck.playing}, Ctrl-C ends it"
    if deck.time < PERIOD:  # its first update comes before the approach
        return f"approaching the first pose of {deck.playing}"
    going = "" if deck.settled else " (on its way)"
    until = f" of {seconds:.0f} s" if seconds is not None else " s, Ctrl-C ends it"
    return f"{described(deck.playing, deck.blend)}{going}  {deck.time:.0f}{until}"


@contextmanager
def progress_line(
    deck: PlayableDeck, stop: StopRequest, seconds: float | None, *, prompt: bool, stream: TextIO | None = None
) -> Iterator[None]:
    """Shows the progress line in the block, if the stream is a terminal; with a prompt only the end is shown.

    A thread writes it: a terminal that blocks must not delay the loop.
    """
    out = sys.stderr if stream is None else stream
    if not out.isatty():
        yield
        return
    over = threading.Event()

    def show() -> None:
        shown = ""
        with suppress(OSError, ValueError):  # a terminal that has gone
            while not over.wait(PERIOD):
                words = words_of(deck, stop, seconds)
                if words == shown or (prompt and not stop):
                    continue
                shown = words
                width = shutil.get_terminal_size().columns - 1
                # The cursor goes back to the start, so that what others print replaces the line.
                out.write(f"\n{words}\n" if prompt else f"\r\x1b[K{words[:width]}\r")
                out.flush()
                if prompt:
                    return
            if shown and not prompt:
                out.write("\x1b[K")
                out.flush()

    line = threading.Thread(target=show, daemon=True)
    line.start()
    try:
        yield
    finally:
        over.set()
        line.join(1.0)


_AT_ONCE = 0.05  # s: a fall before this is reported as one at once
_FEET = "; with --walk or --balance it can keep on its feet"
_CAUSES_SHOWN = 10  # the latest
_OFTEN = 0.02  # share of the ticks from which a joint that is held back is named
_OVERRUNS_EVERY = 1.0  # s from one event on overruns to the next, which has all since
_FAULTS_EVERY = 0.1  # s from one check for faults to the next


class RunNews:
    """Sends events for overruns, faults, replayed commands and recognized motions."""

    def __init__(
        self,
        handler: CommandHandler,
        clock: Clock,
        channels: Sequence[Channel],
        servers: Sequence[CommandServer],
        recognition: RecognitionState | None = None,
    ) -> None:
        self._handler, self._clock, self._channels, self._servers = handler, clock, channels, servers
        self._recognition = recognition
        self._overruns = self._replayed = 0
        self._faults = [0] * len(channels)
        self._incidents: list[Counter[str]] = [Counter() for _ in channels]
        self._waiting: list[list[str]] = [[] for _ in channels]
        self._motion = ""
        self._ticks = 0
        self._overruns_every = max(1, round(_OVERRUNS_EVERY / clock.period))
        self._faults_every = max(1, round(_FAULTS_EVERY / clock.period))

    def update(self) -> None:
        """Sends what is new; once a tick."""
        self._ticks += 1
        if self._ticks % self._faults_every:
            return
        if self._clock.overruns != self._overruns and self._ticks % self._overruns_every < self._faults_every:
            new, self._overruns = self._clock.overruns - self._overruns, self._clock.overruns
            self._handler.notify("overrun", f"{counted(new, 'tick')} came more than a period late")
        self._report_faults()
        replayed = sum(server.traffic.replayed for server in self._servers)
        if replayed != self._replayed:
            new, self._replayed = replayed - self._replayed, replayed
            text = f"{new} recorded datagrams that were sent again were refused"
            self._handler.notify("replayed", text)
            print(f"motiondeck: {text}", file=sys.stderr)
        seen = self._recognition.seen if self._recognition is not None else None
        if seen is not None and seen[0] != self._motion:
            self._motion = seen[0]
            self._handler.notify("recognized", f"it looks like {seen[0]} (confidence {seen[1]:.2f})", seen[0])

    def _report_faults(self) -> None:
        for index, channel in enumerate(self._channels):
            if channel.faults != self._faults[index]:
                self._faults[index] = channel.faults
                fault = f"{channel.name}: {channel.fault}"
                parked = f"{fault.removesuffix('.')}. Nothing more is sent to it"
                self._handler.notify("fault", parked if channel.parked else fault)
            # Only the latest are kept: new ones are found by the count of each.
            now = Counter[str](getattr(channel.output, "incidents", ()))
            before, self._incidents[index] = self._incidents[index], now
            new, waiting = [*(now - before).elements()], self._waiting[index]
            explain = getattr(channel.output, "explain", None)
            # What has one cause does not all come within one check: the first ones wait for the next.
            self._waiting[index] = new if explain is not None and not waiting else []
            ready = [] if self._waiting[index] else waiting + new
            for text, fault in explain(ready) if explain is not None else ((each, True) for each in ready):
                self._handler.notify("fault" if fault else "servo", f"{channel.name}: {text}")


def run_report(
    report: LoopReport, joints: Sequence[str], switches: Iterable[CommandedSwitch], permissions: Iterable[Permission]
) -> dict[str, Any]:
    """How the loop went, with joints by their names and the switches that were commanded; see docs/commands.md."""
    full: dict[str, Any] = msgspec.to_builtins(report)
    changed = full.pop("changed")
    full["limited"] = {joint: count for joint, count in zip(joints, changed, strict=True) if count}
    full["switches"] = [
        {
            **{name: getattr(switch, name) for name in ("to", "commanded_s", "first_change_s", "settled_s", "after")},
            "via": list(switch.via),
            **({"blend": [list(part) for part in switch.blend]} if switch.blend else {}),
            **({"fell_back": switch.fell_back} if switch.fell_back else {}),
        }
        for switch in switches
    ]
    full["permissions"] = {permission.name: permission.granted for permission in permissions}
    for output in full["outputs"]:
        if output["name"] == "rig":
            full["rig"] = output
    return full


def summary(report: dict[str, Any]) -> str:
    """A report in a few lines: what happened, then the figures."""
    seconds = report["ticks"] / report["rate_hz"] if report["ticks"] else 0.0
    ended = f"ended after {seconds:.1f} s" if report["ticks"] else "ended before anything moved"
    lines = [f"{ended}: {report['reason']}", *_happened(report)]
    late, work = report["lateness_us"], report["work_us"]
    if "rig" in report:
        rig = report["rig"]
        error = rig["tracking_rmse_rad"]
        lines.append(
            f"rig: {counted(rig['joints'], 'joint')} at {rig['hz']:g} Hz, {counted(rig['faults'], 'fault')}"
            + (f", tracking error {np.degrees(error):.2f} deg (rms)" if error is not None else "")
        )
    lines.append(
        f"loop: {report['ticks']} ticks at {report['rate_hz']:.2f} Hz; {report['overruns']} began more than a period "
        f"late, {report['skipped']} were skipped"
    )
    lines.append(
        f"tick: {late['p50']:.0f} us late in the median, {late['p999']:.0f} us at p99.9; "
        f"{work['p50']:.0f} us of work in the median"
    )
    return "\n".join(lines)


def _happened(report: dict[str, Any]) -> list[str]:
    lines = [f"{verdict['name']}: {verdict['words']}" for verdict in report.get("verdicts", ())]
    held_back = [one for one in report.get("limited", {}).items() if one[1] > _OFTEN * report["ticks"]]
    if often := sorted(held_back, key=lambda item: -item[1]):
        most = ", ".join(f"{joint} ({count} of {report['ticks']} ticks)" for joint, count in often[:3])
        more = f" and {counted(len(often) - 3, 'more joint')}" if len(often) > 3 else ""
        lines.append(f"held back: {most}" + more)
    if report["switches"]:
        times = [s["settled_s"] - s["commanded_s"] for s in report["switches"] if s["settled_s"] is not None]
        median = " (median)" if len(times) > 1 else ""
        settled = f", settled after {np.median(times):.2f} s{median}" if times else ""
        lines.append(f"{counted(len(report['switches']), 'switch')}{settled}")
    lines += [f"went to {s['to']} by way of {', '.join(s['via'])}" for s in report["switches"] if s["via"]]
    if report["restarts"]:
        lines.append(f"the network lost its motion and was restarted {report['restarts']} times")
    lines += [f"at {refused['at']:g} s refused: {refused['reason']}" for refused in report["refused"]]
    if "rig" in report:
        lines += [f"rig: {cause}" for cause in report["rig"]["causes"][-_CAUSES_SHOWN:]]
    for output in report["outputs"]:
        if output.get("fell_s") is not None:
            when = f"after {output['fell_s']:.1f} s" if output["fell_s"] >= _AT_ONCE else "at once"
            up = f"; it got up {counted(output['got_up'], 'time')}" if output.get("got_up") else ""
            has_legs = "near_falls_s" in output
            lines.append(f"the robot fell {when}{up if has_legs else _FEET}")
    for output in report["outputs"]:
        if travel := output.get("travel"):
            lines.append(f"walked {travel['walked_m']:.1f} m; the motion went {travel['asked_m']:.1f} m")
    if kept := report.get("kept_apart"):
        most = sorted(kept.items(), key=lambda item: -item[1])[:3]
        lines.append("kept apart: " + ", ".join(f"{pair} ({counted(count, 'tick')})" for pair, count in most))
    if not report.get("recording", {"complete": True})["complete"]:
        file, reason = report["recording"]["file"], report["recording"].get("reason", "")
        lines.append(f"the recording {file} is cut short" + (f": {reason.removeprefix(f'{file}: ')}" if reason else ""))
    if "recognition" in report:
        from motiondeck.run.recognition.watches import summary_lines

        lines += summary_lines(report["recognition"])
    lines += [f"output {o['name']} was parked: {o['fault']}" for o in report["outputs"] if o["parked"]]
    return lines
