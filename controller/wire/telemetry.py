"""Telemetry: the latest states of the loop in shared memory, for readers in other processes.

A memory-mapped file holds a JSON description, then a ring of slots. The writer fills the slot after the latest one and
then publishes its number; it takes no lock and does not depend on readers. A slot carries its number before and after
its values and their checksum, so a reader that was overtaken notices it and reads again: it never sees a torn state.

    magic, size of the description | description, fields, writer (JSON) | latest, ended | slot 0 | slot 1 | ...
    slot: number, values (float64), checksum, number
"""

import mmap
import os
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from controller.wire.run_folder import allocate
from motiondeck_base.errors import FileFormatError, MotiondeckError

Array = NDArray[np.float64]

_MAGIC = b"MDTELEM1"
_SLOTS = 8
_MOST_SLOTS = 1 << 16
_RETRIES = 64
_MOST_BYTES = 1 << 26  # more than any state; a header that claims more is damaged


class _StateHeader(msgspec.Struct, forbid_unknown_fields=True):
    description: dict[str, Any]
    fields: dict[str, Annotated[int, msgspec.Meta(ge=0)]]
    writer: Annotated[int, msgspec.Meta(gt=0, lt=2**31)]  # its process id
    slots: Annotated[int, msgspec.Meta(gt=1, le=_MOST_SLOTS)] = _SLOTS


def _layout(header_bytes: int, header: _StateHeader) -> tuple[int, int]:
    """Where `latest` lies, and the size of the file."""
    control = -(-(16 + header_bytes) // 64) * 64
    return control, control + 64 + 8 * header.slots * (sum(header.fields.values()) + 3)


def _views_of(memory: mmap.mmap, control: int, slots: int) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """The numbers `latest` and `ended`, and the words of each slot, shape (slots, values + 3)."""
    words = np.frombuffer(memory, np.uint64, offset=control)
    return words[:2], words[8:].reshape(slots, -1)


def named(values: Array, fields: Mapping[str, int]) -> dict[str, Array]:
    """The part of values (..., V) that belongs to each field, by name: views of shape (..., size)."""
    ends = np.cumsum([*fields.values()]).tolist()
    return {name: values[..., end - size : end] for (name, size), end in zip(fields.items(), ends, strict=True)}


class StateWriter:
    """The loop's side: fill `fields` in place, then `publish`."""

    def __init__(
        self, path: Path, description: Mapping[str, Any], fields: Mapping[str, int], slots: int = _SLOTS
    ) -> None:
        """Creates the file, readable by its owner only, in place of an older one; it appears complete or not at all.

        It is in a directory of the owner's; the caller removes both at the end. Of the states as many as there are
        slots, at least 2, are kept for readers that need every one of them. MotiondeckError if there is no room for it.
        """
        about = _StateHeader(dict(description), dict(fields), os.getpid(), slots)
        header = msgspec.json.encode(about)
        control, size = _layout(len(header), about)
        draft = path.with_name(f".{path.name}.{os.getpid()}")
        draft.unlink(missing_ok=True)
        handle = os.open(draft, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        try:
            allocate(handle, size, path)
            memory = mmap.mmap(handle, size)
        except MotiondeckError:
            draft.unlink(missing_ok=True)
            raise
        finally:
            os.close(handle)
        memory[: 16 + len(header)] = _MAGIC + struct.pack("<Q", len(header)) + header
        draft.replace(path)
        self._control, self._slots = _views_of(memory, control, slots)
        self.values = np.full(sum(fields.values()), np.nan)
        self._words = self.values.view(np.uint64)
        self._number = 0
        # The values of the next `publish`, each a float64 array to write into; NaN until it is written.
        self.fields = named(self.values, fields)

    def publish(self, **values: Array | float) -> None:
        """Publishes the state in `fields`, after setting the given ones; others keep their value."""
        for name, value in values.items():
            self.fields[name][:] = value
        self._number += 1
        slot = self._slots[self._number % len(self._slots)]
        slot[0] = 0  # in the making
        slot[1:-2] = self._words
        slot[-2] = zlib.crc32(self.values.data)
        slot[-1] = self._number
        slot[0] = self._number
        self._control[0] = self._number

    def close(self) -> None:
        """Marks the end of the states for readers; may be called twice."""
        self._control[1] = 1


class StateReader:
    """A reader's side; it never disturbs the writer."""

    def __init__(self, path: Path) -> None:
        """Opens what a StateWriter has made; FileFormatError if the file cannot be opened or is not a state file."""
        try:
            with path.open("rb") as file:
                start = file.read(16)
                length = struct.unpack("<Q", start[8:])[0] if start[:8] == _MAGIC and len(start) == 16 else _MOST_BYTES
                if length >= _MOST_BYTES:
                    raise FileFormatError(f"{path}: this is not a state file of a motion deck")
                header = msgspec.json.decode(file.read(length), type=_StateHeader)
                control, size = _layout(length, header)
                if size > _MOST_BYTES or os.fstat(file.fileno()).st_size != size:
                    raise FileFormatError(f"{path}: this state file is cut short or damaged")
                memory = mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ)
        except OSError as error:
            raise FileFormatError(f"{path}: cannot be read ({error.strerror}); is the deck running?") from error
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            raise FileFormatError(f"{path}: the description of this state file is damaged ({error})") from error
        self.description, self.fields, self._writer = header.description, header.fields, header.writer
        self._control, self._slots = _views_of(memory, control, header.slots)

    @property
    def ended(self) -> bool:
        """Whether the writer has closed the state, or its process is gone."""
        if self._control[1]:
            return True
        try:
            os.kill(self._writer, 0)  # signal 0 only checks
        except OSError as error:
            return isinstance(error, ProcessLookupError)
        return False

    @property
    def latest(self) -> int:
        """The number of the latest state; 0 before the first one."""
        return int(self._control[0])

    def read(self) -> dict[str, Array] | None:
        """A copy of the latest state, each field an array, or None before the first one."""
        for _ in range(_RETRIES):
            number = self.latest
            if number == 0:
                return None
            values = self._take(number)
            if values is not None:
                return named(values, self.fields)
        return None

    def since(self, number: int) -> tuple[int, Array]:
        """The number of the last state, and all states after the one with a number (0 for all), oldest first.

        All fields are in one array, shape (states, V). States that the writer has overwritten meanwhile are missing.
        """
        latest = self.latest
        oldest = max(number + 1, latest - len(self._slots) + 1)
        taken = [self._take(n) for n in range(oldest, latest + 1)]
        rows = [values for values in taken if values is not None]
        return latest, np.array(rows).reshape(len(rows), -1) if rows else np.empty((0, sum(self.fields.values())))

    def _take(self, number: int) -> Array | None:
        """A copy of the values of a state, or None where it is torn or overwritten."""
        shared = self._slots[number % len(self._slots)]
        slot = shared.copy()
        values = slot[1:-2].view(np.float64)
        untouched = slot[0] == slot[-1] == shared[0] == number
        return values if untouched and slot[-2] == zlib.crc32(values.data) else None
