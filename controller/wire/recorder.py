"""The recorder: a process that copies every tick from shared memory, and events from a pipe, into a file.

So no disk can delay the loop.
"""

import contextlib
import os
import signal
import sys
import time
from pathlib import Path

from controller.wire.run_recording import RecordingWriter
from controller.wire.telemetry import StateReader
from motiondeck_base.errors import MotiondeckError

CHUNK_SECONDS = 0.25


def record(state: Path, out: Path, events: int | None = None) -> int:
    """Records until the deck ends or its process is gone, including what is still in shared memory then.

    Events come as lines of JSON from an open file, if one is given.

    Returns how many ticks are missing, because this process was held up for longer than the shared memory keeps them.
    FileFormatError if there is no such deck, or the file cannot be written.
    """
    reader = StateReader(state)
    writer = RecordingWriter(out, reader.description, reader.fields)
    number, lost, ended = 0, 0, False
    while not ended:
        time.sleep(CHUNK_SECONDS)
        ended = reader.ended  # read before the last ticks are
        before = number
        number, rows = reader.since(before)
        if len(rows):
            writer.append(rows)
        with contextlib.suppress(BlockingIOError):
            while events is not None and (lines := os.read(events, 1 << 16)):  # the pipe holds no more
                writer.append_events(lines)
        lost += number - before - len(rows)
    writer.close()
    return lost


def reason_file(state: Path) -> Path:
    """Where the recorder of a deck leaves why it has ended too early, for the report of the run."""
    return state.with_name("recorder-ended")


def main(state: str, out: str, events: str = "") -> int:
    """The command line of the recorder: shared state, recording, the file number of events; returns its exit code."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # it ends the deck; its last ticks are recorded too
    os.nice(5)
    try:
        lost = record(Path(state), Path(out), int(events) if events else None)
    except MotiondeckError as error:
        print(f"motiondeck: the recording has ended: {error}", file=sys.stderr)
        with contextlib.suppress(OSError):
            reason_file(Path(state)).write_text(str(error))
        return 1
    if lost:
        print(f"motiondeck: {out} lacks {lost} ticks: its process was held up for too long", file=sys.stderr)
    return int(lost > 0)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
