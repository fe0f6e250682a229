"""Reads a gamepad through the kernel's event interface (evdev): what is pressed, and how far a stick is pushed.

Codes and directions follow the kernel's gamepad specification (Linux, Documentation/input/gamepad.rst), so one table
serves every gamepad whose driver follows it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from evdev import InputDevice

# Linux, include/uapi/linux/input-event-codes.h; written out because evdev is an optional dependency.
EV_SYN, EV_KEY, EV_ABS = 0, 1, 3
SYN_DROPPED = 3
BTN_SOUTH, BTN_EAST, BTN_NORTH, BTN_WEST = 0x130, 0x131, 0x133, 0x134
BTN_TR = 0x137
BTN_START = 0x13B
BTN_DPAD_LEFT, BTN_DPAD_RIGHT = 0x222, 0x223
ABS_Y, ABS_HAT0X = 0x01, 0x10


class Button(Enum):
    """The buttons in use, by their labels on an Xbox gamepad."""

    A, B, X, Y, START, LEFT, RIGHT, SHOULDER = range(8)


class Stick(NamedTuple):
    """The left stick has moved: -1 is up, 1 is down, 0 is released."""

    y: float


BUTTONS = {
    BTN_SOUTH: Button.A,
    BTN_EAST: Button.B,
    BTN_NORTH: Button.X,
    BTN_WEST: Button.Y,
    BTN_TR: Button.SHOULDER,
    BTN_START: Button.START,
    BTN_DPAD_LEFT: Button.LEFT,
    BTN_DPAD_RIGHT: Button.RIGHT,
}


def events(device: InputDevice[str]) -> Iterator[Button | Stick]:
    """Buttons as they are pressed, and positions of the left stick, until the device is unplugged (OSError)."""
    # Where the kernel drops events because they were read too slowly, an emergency stop must not be lost with them: B
    # counts as pressed if it is held down afterwards.
    stick = device.absinfo(ABS_Y)
    for event in device.read_loop():
        if event.type == EV_KEY and event.value == 1 and event.code in BUTTONS:
            yield BUTTONS[event.code]
        elif event.type == EV_ABS and event.code == ABS_HAT0X and event.value:
            yield Button.RIGHT if event.value > 0 else Button.LEFT
        elif event.type == EV_ABS and event.code == ABS_Y:
            yield Stick(deflection(event.value, stick.min, stick.max))
        elif event.type == EV_SYN and event.code == SYN_DROPPED and BTN_EAST in device.active_keys():
            yield Button.B


def deflection(value: int, lowest: int, highest: int) -> float:
    """A stick's value as -1 to 1; the kernel may report values beyond the range that it states."""
    if lowest >= highest:
        return 0.0
    return min(max((2.0 * value - lowest - highest) / (highest - lowest), -1.0), 1.0)


def open_gamepad(path: Path | None) -> InputDevice[str]:
    """The gamepad at a path (/dev/input/event7), or the first one found; MotiondeckError without evdev or gamepad."""
    try:
        import evdev
    except ImportError:
        raise MotiondeckError('a gamepad needs evdev. Install it with: pip install "motiondeck[gamepad]"') from None
    if path is None:
        for device in map(evdev.InputDevice, evdev.list_devices()):
            if _is_gamepad(device.capabilities(absinfo=False)):
                return device
        raise MotiondeckError(
            "there is no gamepad that you may read. Plug one in; if it is, run: sudo usermod -aG input $USER, "
            "and log in again"
        )
    try:
        device = evdev.InputDevice(str(path))
    except OSError as error:
        raise MotiondeckError(
            f"{path}: no gamepad can be read here ({error.strerror or error}). Without --device the first one is taken"
        ) from None
    if not _is_gamepad(device.capabilities(absinfo=False)):
        raise MotiondeckError(f"{path}: '{device.name}' is not a gamepad. Without --device the first one is taken")
    return device


def _is_gamepad(capabilities: Mapping[int, Sequence[int]]) -> bool:
    """Every gamepad has the south button, by the kernel's specification; the tempo needs a stick besides."""
    return BTN_SOUTH in capabilities.get(EV_KEY, ()) and ABS_Y in capabilities.get(EV_ABS, ())
