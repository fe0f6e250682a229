"""`motiondeck plot`: lateness, tracking, motions, commands and what went wrong in a recorded run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from motiondeck.page.event_looks import LOOKS, ROUTINE

if TYPE_CHECKING:
    from controller.wire.run_recording import RunRecording


def plot(
    file: Annotated[Path, Argument(metavar="FILE", help="A recording made with `play --record FILE`.")],
    out: Annotated[Path | None, Option(metavar="PICTURE", help="A .png, .svg or .pdf (default: FILE.png).")] = None,
    as_json: Annotated[bool, Option("--json", help="Print the figures as one JSON object, draw nothing.")] = False,
) -> None:
    """Plot a recorded run: lateness, tracking, motions and commands.

    Example:  motiondeck plot show.rec --out show.png
    """
    from controller.wire.run_recording import load_recording
    from motiondeck_base.errors import MotiondeckError

    recording = load_recording(file)
    if recording.ticks == 0:
        raise MotiondeckError(f"{file}: no tick in it. Record a run that plays: motiondeck play --record FILE.")
    figures = measure(recording)
    if as_json:
        print(json.dumps(figures))
        return
    picture = out or file.with_name(file.name + ".png")
    went_wrong = [event for event in figures["events"] if LOOKS.get(event["kind"], ROUTINE).mark == "bad"]
    _draw(recording, went_wrong, picture)
    late = figures["lateness_us"]
    print(f"{figures['ticks']} ticks over {figures['seconds']:.1f} s, {figures['lost_ticks']} lost by the recorder")
    print(f"lateness p50 {late['p50']:.0f} us, p99.9 {late['p999']:.0f} us; {figures['commands']} commands")
    if figures["tracking_rmse_rad"] is not None:
        print(f"tracking error {figures['tracking_rmse_rad']:.4f} rad (rms)")
    for event in went_wrong:
        print(f"at {event['s']:.2f} s {event['kind']}: {event['text']}")
    print(f"wrote {picture}")


def measure(recording: RunRecording) -> dict[str, Any]:
    """The figures of a recording, as `--json` prints them."""
    import numpy as np

    fields = recording.fields
    tick, late = fields["tick"][:, 0], fields["late_us"][:, 0]
    # Joints are read before the targets of a tick are written, so they follow those of the tick before.
    error = fields["measured"][1:] - fields["targets"][:-1]
    error = error[np.isfinite(error)]
    p50, p99, p999 = np.percentile(late, (50.0, 99.0, 99.9))
    return {
        "ticks": recording.ticks,
        "seconds": recording.ticks / float(recording.description["rate"]),
        "lost_ticks": int(tick[-1] - tick[0]) + 1 - recording.ticks,
        "complete": recording.complete,
        "lateness_us": {"p50": float(p50), "p99": float(p99), "p999": float(p999), "max": float(late.max())},
        "overruns": int(fields["overruns"][-1, 0]),
        "commands": int(np.count_nonzero(fields["command"])),
        "refused": int(np.count_nonzero(fields["refused"])),
        "events": [
            {"s": (one.tick + 1) / recording.description["rate"], "kind": one.event.kind, "text": one.event.text}
            for one in recording.events
        ],
        "tracking_rmse_rad": float(np.sqrt(np.square(error).mean())) if len(error) else None,
    }


def _draw(recording: RunRecording, went_wrong: list[dict[str, Any]], picture: Path) -> None:
    import numpy as np

    from controller.wire.messages.command_table import RECORDED
    from motiondeck.pictures.figures import new_figure, save

    fields, motions = recording.fields, list(recording.description["motions"])
    time = fields["tick"][:, 0] / float(recording.description["rate"])
    figure = new_figure(11.0, 8.0)
    loop, tracking, playing = figure.subplots(3, 1, sharex=True)
    loop.plot(time, fields["late_us"], ".", markersize=2, label="lateness of a tick")
    loop.plot(time, fields["work_us"], ".", markersize=2, label="work of a tick")
    loop.set(ylabel="µs", yscale="symlog")
    loop.legend(loc="upper right")
    error = np.abs(fields["measured"][1:] - fields["targets"][:-1])
    known = np.isfinite(error)
    worst = np.where(known, error, 0.0).max(1)
    mean = np.sqrt(np.where(known, error**2, 0.0).sum(1) / np.maximum(known.sum(1), 1))
    tracking.plot(time[1:], np.degrees(worst), linewidth=0.7, label="worst joint")
    tracking.plot(time[1:], np.degrees(mean), linewidth=0.7, label="root mean square over joints")
    tracking.set(ylabel="tracking error, deg")
    tracking.legend(loc="upper right")
    blended = fields.get("blend_motion", np.empty((len(time), 0)))
    shown = sorted({int(index) for index in (*fields["playing"][:, 0], *blended[blended >= 0.0])})
    row = {index: place for place, index in enumerate(shown)}
    for event in went_wrong:
        tracking.axvline(event["s"], color="C6", linewidth=0.7)
        tracking.annotate(event["kind"], (event["s"], 0.0), rotation=90, fontsize=7, color="C6")
    playing.step(time, [row[int(index)] for index in fields["playing"][:, 0]], where="post")
    for numbers in blended.T:
        there = numbers >= 0.0
        playing.plot(time[there], [row[int(index)] for index in numbers[there]], "C0.", markersize=1)
    playing.set_yticks(range(len(shown)), [motions[index] for index in shown])
    playing.set(xlabel="s", ylim=(-0.5, len(shown) - 0.3))
    for at in np.flatnonzero(fields["command"][:, 0]):
        name = RECORDED[int(fields["command"][at, 0])]
        colour = "red" if name == "estop" or fields["refused"][at, 0] else "grey"
        playing.axvline(time[at], color=colour, linewidth=0.7)
        playing.annotate(name, (time[at], len(shown) - 0.35), rotation=90, va="top", fontsize=7, color=colour)
    save(figure, picture)
