"""The report of a run: what `play --json` prints, and the same in a few lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import msgspec
import numpy as np

from controller.cli.session.recognition_watch import summary_lines
from controller.deck.switch import CommandedSwitch
from controller.loop.loop import LoopReport
from controller.loop.permissions import Permission

_INCIDENTS_SHOWN = 10  # the latest


def run_report(
    report: LoopReport,
    joints: Sequence[str],
    switches: Iterable[CommandedSwitch],
    permissions: Iterable[Permission],
) -> dict[str, Any]:
    """How the loop went, with joints by their names and the switches that were commanded; see docs/commands.md."""
    full: dict[str, Any] = msgspec.to_builtins(report)
    changed = full.pop("changed")
    full["limited"] = {joint: count for joint, count in zip(joints, changed, strict=True) if count}
    full["switches"] = [
        {
            "to": switch.to,
            "commanded_s": switch.commanded_s,
            "first_change_s": switch.first_change_s,
            "settled_s": switch.settled_s,
            "after": switch.after,
            "via": list(switch.via),
            **({"blend": list(switch.blend)} if switch.blend is not None else {}),
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
    """A report in a few lines."""
    late, work = report["lateness_us"], report["work_us"]
    lines = [
        f"{report['reason']}: {report['ticks']} ticks at {report['rate_hz']:.2f} Hz, "
        f"{report['overruns']} overruns, {report['skipped']} ticks skipped",
        f"lateness p50 {late['p50']:.0f} us, p99.9 {late['p999']:.0f} us; work p50 {work['p50']:.0f} us",
    ]
    if report["switches"]:
        times = [s["settled_s"] - s["commanded_s"] for s in report["switches"] if s["settled_s"] is not None]
        settled = f", settled after {np.median(times):.2f} s (median)" if times else ""
        lines.append(f"{len(report['switches'])} switches{settled}")
    lines += [f"went to {s['to']} by way of {', '.join(s['via'])}" for s in report["switches"] if s["via"]]
    if report["restarts"]:
        lines.append(f"the network lost its motion and was restarted {report['restarts']} times")
    lines += [f"at {refused['at']:g} s refused: {refused['reason']}" for refused in report["refused"]]
    if "rig" in report:
        rig = report["rig"]
        error = rig["tracking_rmse_rad"]
        lines.append(
            f"rig: {rig['joints']} joints at {rig['hz']:g} Hz, {rig['faults']} faults"
            + (f", tracking error {np.degrees(error):.2f} deg (rms)" if error is not None else "")
        )
        lines += [f"rig: {incident}" for incident in rig["incidents"][-_INCIDENTS_SHOWN:]]
    lines += [f"the robot fell after {o['fell_s']:.1f} s" for o in report["outputs"] if o.get("fell_s") is not None]
    if kept := report.get("kept_apart"):
        most = sorted(kept.items(), key=lambda item: -item[1])[:3]
        lines.append("kept apart: " + ", ".join(f"{pair} ({count} ticks)" for pair, count in most))
    if not report.get("recording", {"complete": True})["complete"]:
        lines.append(f"the recording {report['recording']['file']} is not complete")
    lines += summary_lines(report["recognition"]) if "recognition" in report else []
    lines += [f"output {o['name']} was parked: {o['fault']}" for o in report["outputs"] if o["parked"]]
    return "\n".join(lines)
