"""Outputs that other packages provide: found by the entry point group "motiondeck.outputs", opened by name.

An entry point names a class (or a function) that is called with `joints`, `rate` and `argument` and returns an object
with `write` and `close`; see `PluginOutput`.
"""

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from controller.loop.output_channel import Channel
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from motiondeck_base.errors import MotiondeckError, UnknownNameError, in_words

GROUP = "motiondeck.outputs"

LATEST = 0.5  # the share of a tick that a write may take

_LONGEST_LAG = 0.5  # s


class PluginOutput(Protocol):
    """An output of another package.

    It may also have `measured()`, which returns the measured joint positions (J,), rad, NaN for a joint without a
    sensor, or None, `report()`, which returns its entry in the report of the run, and `lag`, which says how long after
    a write each joint is there, shape (J,), s. All calls come from the thread of the loop.
    """

    def write(self, targets: Array, pose: Pose) -> None:
        """Takes the targets (J,), rad, of a tick, read-only, and the pose they come from; it must not wait."""

    def close(self) -> None:
        """Ends the output; called once, when the joints are at rest."""


class PluggedOutput:
    """An output of another package in a loop of a rate, Hz; fits `deck.interfaces.Output`."""

    def __init__(
        self, name: str, plugin: PluginOutput, joints: int, rate: float, now: Callable[[], float] = time.perf_counter
    ) -> None:
        self.name = name
        self._plugin, self._joints, self._longest, self._now = plugin, joints, LATEST / rate, now
        self._measured: Callable[[], ArrayLike | None] = getattr(plugin, "measured", lambda: None)
        self._report: Callable[[], Mapping[str, object]] = getattr(plugin, "report", dict)
        self._closed = False
        self.lag = np.asarray(getattr(plugin, "lag", np.zeros(joints)), dtype=np.float64)
        if self.lag.shape != (joints,) or not ((self.lag >= 0.0) & (self.lag <= _LONGEST_LAG)).all():
            raise MotiondeckError(f"output {name}: its lag must be {joints} numbers from 0 to {_LONGEST_LAG} s")

    def write(self, targets: Array, pose: Pose) -> None:
        """Writes the targets; MotiondeckError if that took more than a share LATEST of a tick."""
        began = self._now()
        self._plugin.write(targets, pose)
        took = self._now() - began
        if took > self._longest:
            raise MotiondeckError(f"a write took {1e3 * took:.1f} ms, more than {1e3 * self._longest:.1f} ms")

    def measured(self) -> Array | None:
        """The measured joint positions, shape (J,), rad, if it has any; MotiondeckError if they have another shape."""
        measured = self._measured()
        if measured is None:
            return None
        positions = np.asarray(measured, dtype=np.float64)
        if positions.shape != (self._joints,):
            raise MotiondeckError(f"measured positions of shape {positions.shape} for {self._joints} joints")
        return positions

    def report(self) -> Mapping[str, object]:
        """The output's own report."""
        return {"kind": "plugin", **self._report()}

    def close(self) -> None:
        """Closes the output; what it raises is not passed on, since others are still to be closed."""
        if not self._closed:
            self._closed = True
            try:
                self._plugin.close()
            except Exception as error:
                print(f"motiondeck: output {self.name} was not closed: {in_words(error)}", file=sys.stderr)


def open_outputs(opening: ExitStack, specs: Sequence[str], joints: Sequence[str], rate: float) -> list[Channel]:
    """Opens outputs by their specification, NAME or NAME:ARGUMENT; `opening` closes them.

    UnknownNameError if no installed package has the name; it names the nearest. MotiondeckError if one does not open.
    """
    from importlib.metadata import entry_points  # slow to import

    found: dict[str, Any] = {point.name: point for point in entry_points(group=GROUP)}
    channels: list[Channel] = []
    for spec in specs:
        name, _, argument = spec.partition(":")
        if not found:
            raise UnknownNameError(f"output '{name}': no installed package provides outputs; see the page 'Python API'")
        UnknownNameError.check("output", name, found)
        try:
            plugin = found[name].load()(joints=tuple(joints), rate=rate, argument=argument)
        except MotiondeckError:
            raise
        except Exception as error:
            where = f"output '{name}' ({found[name].value})"
            raise MotiondeckError(f"{where} cannot be opened: {in_words(error)}") from error
        output = PluggedOutput(name, plugin, len(joints), rate)
        opening.callback(output.close)
        channels.append(Channel(output))
    return channels
