"""What the answers of emulated servos are made of; those of a family are in the file `answers` of its folder."""

# ruff: noqa: D102 (`Device`, `EmulatedBus` and the `answers` of a family document what these do)

from collections.abc import Iterable
from importlib import import_module
from typing import NamedTuple, Protocol, cast

from hardware.families.family import Family
from hardware.families.frames import Frame
from hardware.families.series import Series

RESULT_FAIL, INSTRUCTION, CHECKSUM, RANGE, LENGTH, LIMIT, ACCESS = range(1, 8)
"""Why a servo refuses, as in `frames.ERRORS`."""
RESET_ALL, RESET_BUT_ID, RESET_BUT_ID_AND_BAUD = 0xFF, 0x01, 0x02  # what a factory reset keeps
BOOT_TIME = 0.1  # how long a servo is deaf after a reboot, s; the manuals give no figure


class Answer(NamedTuple):
    """What the servos put on the wire in one go."""

    delay: float  # how long they waited before, s
    data: bytes
    id: int  # the sender; BROADCAST where several write one frame


class EmulatedServo(Protocol):
    """What is needed of a servo: `Device` of the emulator; methods that change it give the reason of a refusal or 0."""

    series: Series

    @property
    def id(self) -> int: ...
    @property
    def return_delay(self) -> float: ...
    @property
    def alert(self) -> bool: ...
    @property
    def answers_fast_reads(self) -> bool: ...
    def __getitem__(self, name: str) -> int: ...
    def read(self, address: int, length: int) -> bytes | None: ...
    def write(self, address: int, data: bytes, shadow: bool = False) -> int: ...
    def register(self, address: int, data: bytes, shadow: bool = False) -> int: ...
    def act(self) -> int: ...
    def reboot(self, deaf_until: float) -> None: ...
    def factory_reset(self, keep: int, deaf_until: float) -> bool: ...
    def clear(self) -> int: ...
    def back_up(self, restore: bool | None, deaf_until: float) -> int: ...


class EmulatedServos(Protocol):
    """What is needed of the bus: `EmulatedBus`."""

    strict: bool
    time: float

    def hearing(self, id: int, family: Family) -> Iterable[EmulatedServo]: ...
    def shadows(self, id: int, family: Family) -> Iterable[EmulatedServo]: ...
    def everybody(self, family: Family) -> Iterable[EmulatedServo]: ...
    def ids(self) -> list[int]: ...
    def mixed(self, answers: list[Answer]) -> Answer: ...
    def reindex(self) -> None: ...


class Answers(Protocol):
    """The module `answers` of a family."""

    def answer(self, bus: EmulatedServos, frame: Frame) -> list[Answer]: ...
    def damaged(self, bus: EmulatedServos, id: int) -> list[Answer]: ...


def answers_of(family: Family) -> Answers:
    """What answers the instructions of a family."""
    return cast(Answers, import_module(f"hardware.families.{family.name}.answers"))


def alone_or_mixed(bus: EmulatedServos, answers: list[Answer]) -> list[Answer]:
    """Answers of servos with the same ID, mixed into one where there are several."""
    return answers if len(answers) < 2 else [bus.mixed(answers)]


def in_turn(bus: EmulatedServos, asked: Iterable[list[Answer]]) -> list[Answer]:
    """The answers of servos that each wait for the one before: on a strict bus a silent one silences all behind it."""
    answers: list[Answer] = []
    for own in asked:
        if not own and bus.strict:
            break
        answers += alone_or_mixed(bus, own)
    return answers


def sync_write(bus: EmulatedServos, family: Family, params: bytes) -> list[Answer]:
    """Carries out a sync write of `plain_frames`, which is unanswered."""
    if len(params) > 2 and params[1]:
        size = params[1] + 1
        for at in range(2, len(params) - size + 1, size):
            for device in bus.hearing(params[at], family):
                device.write(params[0], params[at + 1 : at + size])
        bus.reindex()
    return []
