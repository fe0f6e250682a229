"""Checks arguments of the public API: time series, matrices and numbers, each in one form or refused."""

from numbers import Integral, Real

import numpy as np
from numpy.typing import ArrayLike

from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError


def time_series(value: ArrayLike, what: str, channels: int | None = None) -> Array:
    """A time series, frames by channels of any real numbers, as an array (T, D) of float64 in C order.

    MotiondeckError, which calls it `what`, if it has another shape, another D than `channels`, is empty, or holds
    anything but finite real numbers; it names the first such frame and channel.
    """
    try:
        found = np.asarray(value)
    except ValueError:  # rows of different lengths
        raise MotiondeckError(f"{what} has rows of different lengths; give as many channels in every frame") from None
    if found.dtype.kind not in "biuf":
        raise MotiondeckError(f"{what} holds {found.dtype.name} values; give real numbers")
    if found.ndim != 2 or 0 in found.shape:
        remedy = ". For one channel give it as column: x[:, None]" if found.ndim == 1 and len(found) else ""
        raise MotiondeckError(f"{what} is of shape {found.shape}; (frames, channels) is needed, one at least{remedy}")
    if channels is not None and found.shape[1] != channels:
        raise MotiondeckError(f"{what} has {found.shape[1]} channels, but {channels} are needed")
    numbers = np.ascontiguousarray(found, dtype=np.float64)
    bad = np.argwhere(~np.isfinite(numbers))
    if len(bad):
        frame, channel = bad[0]
        raise MotiondeckError(f"{what}: frame {frame}, channel {channel} is {numbers[frame, channel]}. Cut or fill it.")
    return numbers


def points(value: ArrayLike, what: str, least: float = -np.inf, most: float = np.inf) -> Array:
    """A number or a row of numbers as a row of float64; MotiondeckError if one is not from `least` to `most`."""
    try:
        found = np.atleast_1d(np.asarray(value, dtype=np.float64))
    except (TypeError, ValueError):
        raise MotiondeckError(f"{what} is {value!r}; give numbers in a row") from None
    if found.ndim != 1:
        raise MotiondeckError(f"{what} is of shape {found.shape}; give numbers in a row")
    bad = found[~((found >= least) & (found <= most) & np.isfinite(found))]
    if len(bad):
        limits = f"; it lies between {least:g} and {most:g}" if np.isfinite(most) else "; give finite numbers"
        raise MotiondeckError(f"{what} is {bad[0]:g}{limits}")
    return found


def square(value: ArrayLike, what: str, size: int | None = None) -> Array:
    """A matrix (N, N) of float64, with N = `size` if that is known; else MotiondeckError, which calls it `what`."""
    matrix = np.asarray(value, dtype=np.float64)
    expected = "(N, N)" if size is None else f"({size}, {size})"
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or (size is not None and len(matrix) != size):
        raise MotiondeckError(f"{what} is of shape {matrix.shape}; {expected} is needed")
    return matrix


def whole_number(value: object, what: str, least: int = 0) -> int:
    """A whole number of at least `least`; MotiondeckError if it is none."""
    if not isinstance(value, Integral) or int(value) < least:
        raise MotiondeckError(f"{what} is {value!r}; give a whole number, {least} or more")
    return int(value)


def sampling_rate(value: object) -> float:
    """The rate of a time series, Hz; MotiondeckError if it is no number from 1e-9 to 1e12."""
    return number_within(value, "the rate, Hz,", 1e-9, 1e12)


def number_within(value: object, what: str, least: float, most: float) -> float:
    """A number from `least` to `most`; MotiondeckError if it is none."""
    if not isinstance(value, Real) or not least <= float(value) <= most:
        raise MotiondeckError(f"{what} is {value!r}; it lies between {least:g} and {most:g}")
    return float(value)
