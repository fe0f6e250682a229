"""The emergency stops of a show that a member knows. Members send each other theirs, so that all know all."""

from pathlib import Path

import msgspec

from motiondeck.shows.messages import EmergencyStopAll
from motiondeck_base.files import read_kept, write_file

MOST_SENT, _REMEMBERED = 16, 64


class KnownStops:
    """In the order in which they came, those that are over first; may be read from another thread."""

    def __init__(self) -> None:
        self._all: list[EmergencyStopAll] = []

    def __contains__(self, stop: EmergencyStopAll) -> bool:
        """Whether it has come before."""
        return any(known.id == stop.id for known in self._all)

    def add(self, stop: EmergencyStopAll) -> bool:
        """Adds a stop, or notes that it is over; whether it is new."""
        new = stop not in self
        if new:
            self._keep([*self._all, stop])
        elif stop.over:
            self._keep([stop if known.id == stop.id else known for known in self._all])
        return new

    def end(self) -> None:
        """Notes that all are over."""
        self._keep([msgspec.structs.replace(stop, over=True) for stop in self._all])

    @property
    def latest(self) -> list[EmergencyStopAll]:
        """Those that are sent to others."""
        return self._all[-MOST_SENT:]

    @property
    def standing(self) -> list[EmergencyStopAll]:
        """The latest ones that are not over; others send all of these, even if they came in another order there."""
        return [stop for stop in self._all if not stop.over][-MOST_SENT // 2 :]

    def _keep(self, stops: list[EmergencyStopAll]) -> None:
        self._all = sorted(stops, key=lambda stop: not stop.over)[-_REMEMBERED:]


class StopMemory:
    """The stops that a deck was not reset from, in a file: a deck that is started again begins stopped."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def read(self) -> list[EmergencyStopAll]:
        """Those of the deck's last run; none if there is no such file, or it is damaged."""
        return read_kept(self._path, list[EmergencyStopAll]) or []

    def write(self, stops: list[EmergencyStopAll]) -> None:
        """Keeps them; raises a FileFormatError if that is not possible."""
        if stops:
            write_file(self._path, msgspec.json.encode(stops))
        else:
            self._path.unlink(missing_ok=True)
