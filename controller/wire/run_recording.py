"""Recordings of runs: every tick with its command, in a file that loses at most one chunk when its writer dies.

    "MDRECORD", size and checksum of the header | header (JSON): version, description, fields | chunk | chunk | ...
    chunk: rows, checksum | values (float64, little endian), one row a tick
    chunk: EVENTS + bytes, checksum | events (JSON, one a line), each with the tick that it came after

A chunk is written in one piece and checked when it is read: the recording ends before the first chunk that is cut short
or damaged. A chunk of no rows marks a complete recording.
"""

import os
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from controller.wire.messages.replies import Event
from controller.wire.telemetry import Array, named
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import what_it_is

VERSION = 7
READABLE = (1, 2, 3, 4, 5, 6, 7)
"""Version 7 brought events. From version 6 on the fields are those of `DeckSnapshot`. Before, some had other names, and
some were missing: in 1 `robot_root`, `seen` and `confidence`; up to 2 `phase`; up to 3 the lock; up to 4 the blend."""
# Names up to version 5, and those of now.
_RENAMED = {"motion": "playing", "speed": "tempo", "time_s": "at", "blend": "blend_motion", "lock_stage": "lock_state"}
_RENAMED |= {"seen": "seen_motion", "confidence": "seen_confidence"}

MAGIC = b"MDRECORD"
_HEADER, _CHUNK = struct.Struct("<II"), struct.Struct("<II")
EVENTS = 1 << 31  # in the place of the rows: the rest is a number of bytes
_MOST_HEADER = 1 << 20
_MOST_VALUES = 1 << 16
_MOST_ROWS = 50  # of a chunk: a recorder that was held up writes many at once, onto a disk that may fill up meanwhile


class _RecordingHeader(msgspec.Struct, forbid_unknown_fields=True):
    version: int
    description: dict[str, Any]
    fields: dict[str, Annotated[int, msgspec.Meta(ge=0, lt=_MOST_VALUES)]]


class RecordedEvent(msgspec.Struct, frozen=True):
    """An event of the deck, and the number of the last tick before it."""

    tick: int
    event: Event


_event = msgspec.json.Decoder(RecordedEvent)


class RecordingWriter:
    """Writes a recording chunk by chunk; each is on the disk when `append` returns."""

    def __init__(self, path: Path, description: Mapping[str, Any], fields: Mapping[str, int]) -> None:
        """Creates the file, in place of an older one; raises a FileFormatError if it cannot be written."""
        self._path = path
        header = msgspec.json.encode(_RecordingHeader(VERSION, dict(description), dict(fields)))
        try:
            self._file = path.open("wb")
            self._file.write(MAGIC + _HEADER.pack(len(header), zlib.crc32(header)) + header)
            self._file.flush()
        except OSError as error:
            if path.is_file():
                path.unlink()  # unreadable without a header
            raise FileFormatError.unwritable(path, error) from None

    def append(self, rows: Array) -> None:
        """Adds ticks, shape (ticks, V), in chunks; an empty array is the mark of the end.

        FileFormatError if they cannot be written; earlier ticks stay readable.
        """
        with FileFormatError.writing(self._path):
            for start in range(0, max(len(rows), 1), _MOST_ROWS):
                part = rows[start : start + _MOST_ROWS]
                self._write(len(part), np.ascontiguousarray(part, dtype="<f8").tobytes())
            os.fsync(self._file.fileno())

    def append_events(self, lines: bytes) -> None:
        """Adds lines, each a `RecordedEvent` in JSON; they are on the disk with the next `append`. Raises as that."""
        with FileFormatError.writing(self._path):
            self._write(EVENTS + len(lines), lines)

    def _write(self, count: int, data: bytes) -> None:
        self._file.write(_CHUNK.pack(count, zlib.crc32(data)) + data)
        self._file.flush()

    def close(self) -> None:
        """Marks the recording complete and closes it; may be called twice."""
        if not self._file.closed:
            self.append(np.empty((0, 0)))
            self._file.close()


def check_replaceable(path: Path) -> None:
    """Refuses to record over a file that is no recording of a run, or that cannot be read: FileFormatError."""
    try:
        with path.open("rb") as file:
            beginning = file.read(len(MAGIC)) if path.is_file() else b""
    except FileNotFoundError:
        return
    except OSError as error:
        raise FileFormatError.unwritable(path, error) from None
    if beginning not in (b"", MAGIC):
        raise FileFormatError(f"{path}: there is another file of this name, which would be lost. Give another one.")


@dataclass(frozen=True)
class RunRecording:
    """A recording in memory."""

    description: dict[str, Any]  # library, robot, joints, motions, rate (ticks per second), root, balance, walk
    fields: dict[str, Array]  # the values of each field, shape (ticks, size)
    complete: bool
    events: Sequence[RecordedEvent] = ()  # in order; none before version 7

    @property
    def ticks(self) -> int:
        """The number of ticks."""
        return len(next(iter(self.fields.values()))) if self.fields else 0


def load_recording(path: Path) -> RunRecording:
    """Reads all whole chunks of a recording; raises a FileFormatError if it cannot be read or is not a recording."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read ({error.strerror or error})") from None
    if found := what_it_is(path, data):
        raise FileFormatError(f"{path}: {found}")
    place = len(MAGIC) + _HEADER.size
    if data[: len(MAGIC)] != MAGIC or len(data) < place:
        raise FileFormatError(f"{path}: this is not a recording; make one with: motiondeck play --record FILE")
    size, checksum = _HEADER.unpack(data[len(MAGIC) : place])
    text = data[place : place + size]
    if size > _MOST_HEADER or zlib.crc32(text) != checksum:
        raise FileFormatError(f"{path}: the beginning of this recording is damaged")
    try:
        header = msgspec.json.decode(text, type=_RecordingHeader)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise FileFormatError(f"{path}: the beginning of this recording is damaged ({error})") from None
    if header.version not in READABLE:
        known = f"{READABLE[0]} to {READABLE[-1]}"
        raise FileFormatError(f"{path}: recording version {header.version}; this Motiondeck reads versions {known}")
    rows, events, complete = _chunks(data[place + size :], sum(header.fields.values()))
    fields = header.fields
    if header.version < 6:
        fields = {_RENAMED.get(name, name): size for name, size in fields.items()}
    return RunRecording(header.description, named(rows, fields), complete, events)


def _chunks(data: bytes, width: int) -> tuple[Array, list[RecordedEvent], bool]:
    """The rows of all whole chunks, shape (ticks, width), their events, and whether the end is marked."""
    chunks, events = [np.empty((0, width))], list[RecordedEvent]()
    place = 0
    while place + _CHUNK.size <= len(data):
        count, checksum = _CHUNK.unpack_from(data, place)
        place += _CHUNK.size
        size = count - EVENTS if count >= EVENTS else 8 * count * width
        values = data[place : place + size]
        if len(values) < size or zlib.crc32(values) != checksum:
            break
        if count == 0:
            return np.concatenate(chunks), events, True
        if count >= EVENTS:
            try:
                events += _event.decode_lines(values)
            except msgspec.MsgspecError:
                break
        else:
            chunks.append(np.frombuffer(values, "<f8").reshape(count, width))
        place += len(values)
    return np.concatenate(chunks), events, False
