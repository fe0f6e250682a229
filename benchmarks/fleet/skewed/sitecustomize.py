"""Gives every Python process that finds this on its path a steady clock of its own: SKEWED_CLOCK="OFFSET_S PPM"."""

import os
import time

_offset, _ppm = os.environ["SKEWED_CLOCK"].split()
_OFFSET_NS, _PPM = round(float(_offset) * 1e9), int(_ppm)
_true_ns = time.monotonic_ns


def _monotonic_ns() -> int:
    now = _true_ns()
    return now + now * _PPM // 1_000_000 + _OFFSET_NS


time.monotonic_ns = _monotonic_ns
time.monotonic = lambda: _monotonic_ns() * 1e-9
