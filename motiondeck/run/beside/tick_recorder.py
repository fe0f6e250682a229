"""`play --record FILE`: what the loop hands to the recorder's process, once a tick."""

import contextlib
import math
import os
import select
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from controller.loop.loop import LoopState
from controller.motion.rotations import Array
from controller.wire.messages.arguments import Number
from controller.wire.messages.commands import DeckCommand, FollowPerson, Gaze, SetInput
from controller.wire.messages.deck_snapshot import DeckSnapshot
from controller.wire.messages.replies import Event, Refused, Reply
from controller.wire.recorder import reason_file
from controller.wire.run_folder import run_folder
from controller.wire.run_recording import RecordedEvent, check_replaceable
from controller.wire.snapshot_numbers import SnapshotNumbers
from controller.wire.telemetry import StateWriter
from motiondeck.run.beside.child_process import child_process
from motiondeck_base.errors import FileFormatError

KEPT_SECONDS = 8.0  # how far the recorder may fall behind before ticks are lost, s

_PATIENCE = 10.0  # s for the recorder to write the last ticks


class TickRecorder:
    """Writes each tick into shared memory; the last command of a tick goes with it."""

    def __init__(
        self,
        writer: StateWriter,
        numbers: SnapshotNumbers,
        motions: Sequence[str],
        process: subprocess.Popen[bytes],
        state: Path,
        file: Path,
        events: int,
    ) -> None:
        self._writer, self._numbers, self._motions = writer, numbers, motions
        self.process, self._state, self._file, self._events = process, state, file, events
        self._tick = -1
        self._forget()

    def finish(self) -> dict[str, object]:
        """Has the recorder write the last ticks and end; its `file`, and whether it is `complete`, or the `reason`."""
        self._writer.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(_PATIENCE)
        found: dict[str, object] = {"file": str(self._file), "complete": self.process.returncode == 0}
        with contextlib.suppress(OSError):
            found["reason"] = reason_file(self._state).read_text()
        return found

    def note(self, message: DeckCommand, reply: Reply) -> None:
        """Remembers a command and whether it was refused."""
        fields = self._writer.fields
        # A value of a stream gives way to other commands of its tick.
        if not message.row.record or (fields["command"][0] and isinstance(message, FollowPerson | Gaze | SetInput)):
            return
        fields["command"][0] = message.row.record
        fields["refused"][0] = isinstance(reply, Refused)
        numbers = (getattr(message, one.field) for one in message.row.arguments if isinstance(one.argument, Number))
        motion = (float(self._motions.index(name)) for name in message.motions if name in self._motions)
        fields["argument"][0] = next(numbers, next(motion, math.nan))

    def tell(self, event: Event) -> None:
        """Hands an event over, as one that comes after the last tick; it is lost where the recorder is held up."""
        line = msgspec.json.encode(RecordedEvent(self._tick, event)) + b"\n"
        with contextlib.suppress(OSError):  # no room in the pipe, or the recorder has ended
            if len(line) <= select.PIPE_BUF:  # more might be written in part
                os.write(self._events, line)

    def record(self, snapshot: DeckSnapshot, loop: LoopState, measured: Array | None, placed: Array) -> None:
        """Hands one tick over, with measured joint positions (J,), rad, if any, and where the root was meant to be.

        That is position and quaternion, shape (7,), m.
        """
        fields = self._writer.fields
        self._writer.values[: self._numbers.count] = self._numbers.row(snapshot)
        fields["targets"][:] = loop.targets[: len(fields["targets"])]  # of the first robot
        fields["measured"][:] = math.nan if measured is None else measured
        fields["root_position"][:] = loop.pose.root_position
        fields["heading"][0] = loop.pose.heading
        fields["root_rotation"][:] = loop.pose.rotation[0]
        fields["robot_root"][:] = placed
        self._writer.publish()
        self._tick = snapshot.tick
        self._forget()

    def _forget(self) -> None:
        fields = self._writer.fields
        fields["command"][0], fields["argument"][0], fields["refused"][0] = 0.0, math.nan, 0.0


@contextmanager
def recording(out: Path, description: Mapping[str, Any], rate: float) -> Iterator[TickRecorder]:
    """Records into a file from a child process while the block runs; an older recording is replaced.

    The description of the run has the names `motions`, `recognizable` and `joints`; the rate is ticks a second.
    FileFormatError if the file cannot be written, or is there and no recording of a run. MotiondeckError if there is no
    room for what the processes share.
    """
    check_replaceable(out)
    with FileFormatError.writing(out):
        out.open("ab").close()
    joints = description["joints"]
    numbers = SnapshotNumbers(description["motions"], recognizable=description["recognizable"], joints=joints)
    fields = numbers.sizes | {"command": 1, "argument": 1, "refused": 1}
    fields |= {"targets": len(joints), "measured": len(joints)}
    fields |= {"root_position": 3, "heading": 1, "root_rotation": 4, "robot_root": 7}
    with run_folder() as folder:
        state = folder / "ticks"
        writer = StateWriter(state, description, fields, slots=max(2, int(np.ceil(KEPT_SECONDS * rate))))
        events, end = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)  # it keeps what comes before the recorder has started
        arguments = "controller.wire.recorder", str(state), str(out), "0"
        with (
            os.fdopen(events),
            os.fdopen(end, "wb"),
            child_process(*arguments, patience=_PATIENCE, stdin=events) as process,
        ):
            try:
                yield TickRecorder(writer, numbers, description["motions"], process, state, out, end)
            finally:
                writer.close()
