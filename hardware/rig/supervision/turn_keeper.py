"""Keeps on disk in which turn joints stand, beside the loop; only joints that go through several turns.

A joint that leaves its place is noted as moving before it can be half a turn away, and as standing when it has stood
for half a second, or at the end.
"""

import threading
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from hardware.bus.servo_bus import Bus
from hardware.errors import ServoError
from hardware.rig.driving.servo_port import ServoPort
from hardware.rig.registers import read_each
from hardware.rig.scale import Array
from hardware.rig.turn_file import Turn, TurnFile
from motiondeck_base.errors import MotiondeckError

Mask = NDArray[np.bool_]

LOOKS_EVERY = 0.1  # s from one look to the next
STANDS_AFTER = 5  # looks without a motion
_PLAY = 1.0 / 64.0  # of a turn
_RESTS = 1.0 / 1024.0  # of a turn between two looks at the end
_SURE = 0.25  # of a turn between goal and position; farther away, a servo may have restarted
_ENDS_WITHIN = 10  # looks


class TurnKeeper:
    """The kept turns of one port's servos."""

    def __init__(self, port: ServoPort, file: TurnFile, report: Callable[[str], None]) -> None:
        """Looks at the joints of a port that go through several turns, kept in `file`, from now on, and at its end.

        `report` takes what has failed.
        """
        several = port.servos.through_turns
        self._port, self._file, self._report = port, file, report
        self._own, self._rows = port.servos.only(several), port.rows[several]
        self._turn = np.array([joint.table.pulses_per_turn for joint in self._own.joints], dtype=np.float64)
        self._last, self._still = self._places, np.zeros(len(several))
        kept = file.read()
        rows = [kept.get(joint.id, Turn(0, 0, False)) for joint in self._own.joints]
        self._zeros = np.array([row.zero for row in rows], dtype=np.float64)
        self._kept = np.array([row.place if row.stands else np.nan for row in rows])
        port.ended = self.finish

    def look(self) -> None:
        """Keeps what has changed since the last look."""
        places, zeros = self._places, self._port.scale.zero[self._rows]
        goals = self._pulses(self._port.goals[self._port.joint_of])
        rests = (np.abs(places - self._last) < _PLAY * self._turn) & (np.abs(places - goals) < _SURE * self._turn)
        self._last = np.where(rests, self._last, places)
        self._still = np.where(rests, self._still + 1, 0)
        stands, known = self._still >= STANDS_AFTER, (zeros == self._zeros) & np.isfinite(self._kept)
        left = known & ~(np.abs(places - self._kept) < _PLAY * self._turn)
        if (left | (stands & ~known)).any():
            self._keep(places, zeros, stands)

    def finish(self, bus: Bus) -> None:
        """Waits at most a second until the joints rest, and keeps where; does nothing if a servo does not answer."""
        try:
            before, rests = self._read(bus), np.zeros(len(self._rows), dtype=np.bool_)
            for _ in range(_ENDS_WITHIN):
                bus.port.wait(LOOKS_EVERY)
                places = self._read(bus)
                rests, before = np.abs(places - before) < _RESTS * self._turn, places
                if rests.all():
                    break
        except ServoError:
            return
        # One that has restarted, and was not set up again, counts from another zero.
        for places in (self._places, self._pulses(self._port.readings.measured.seen)):
            rests &= np.abs(before - places) < _SURE * self._turn
        self._keep(before, self._port.scale.zero[self._rows], rests)

    @property
    def _places(self) -> Array:
        return self._pulses(self._port.readings.measured.positions)

    def _pulses(self, angles: Array) -> Array:
        return self._port.scale.pulses(angles)[self._rows]

    def _read(self, bus: Bus) -> Array:
        return np.array(read_each(self._own, bus, "present_position"), dtype=np.float64)

    def _keep(self, places: Array, zeros: Array, stands: Mask) -> None:
        rows = zip(self._own.joints, zeros.tolist(), places.tolist(), stands.tolist(), strict=True)
        try:
            self._file.keep({joint.id: Turn(round(zero), round(place), stood) for joint, zero, place, stood in rows})
        except (MotiondeckError, OSError) as error:
            self._report(f"the turns of its joints cannot be kept: {error}")
        self._zeros, self._kept = zeros, np.where(stands, places, np.nan)


class KeeperThread:
    """Has keepers look until `stop`, in a thread, if there are any."""

    def __init__(self, keepers: Sequence[TurnKeeper]) -> None:
        self._keepers, self._over = keepers, threading.Event()
        self._thread = threading.Thread(target=self._run, name="rig-turns", daemon=True)
        if keepers:
            self._thread.start()

    def stop(self) -> None:
        """Ends it."""
        self._over.set()
        if self._keepers:
            self._thread.join()

    def _run(self) -> None:
        while not self._over.wait(LOOKS_EVERY):
            for keeper in self._keepers:
                keeper.look()
