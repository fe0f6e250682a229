"""What the answers of emulated servos are made of; those of a family are in the file `answers` of its folder."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from typing import NamedTuple, Protocol, cast

from hardware.families.family import Family
from hardware.families.frames import Frame
from hardware.families.series import Series

RESULT_FAIL, INSTRUCTION, CHECKSUM, RANGE, LENGTH, LIMIT, ACCESS = range(1, 8)
"""Why a servo refuses, as in `frames.ERRORS`."""
RESET_ALL, RESET_BUT_ID, RESET_BUT_ID_AND_BAUD = 0xFF, 0x01, 0x02
"""What a factory reset keeps."""
BOOT_TIME = 0.1
"""How long a servo is deaf after a reboot, s; the manuals give no figure."""


class Answer(NamedTuple):
    """What the servos put on the wire in one go.

    Attributes:
        delay: how long they waited before, s.
        id: the sender; BROADCAST where several write one frame.
    """

    delay: float
    data: bytes
    id: int


class EmulatedServo(Protocol):
    """What is needed of a servo; methods that change it give the reason of a refusal, 0 for none."""

    series: Series

    @property
    def id(self) -> int:
        """Its ID."""
        ...

    @property
    def alert(self) -> bool:
        """Whether it reports a hardware problem."""
        ...

    @property
    def return_delay(self) -> float:
        """How long it waits before it answers, s."""
        ...

    @property
    def answers_fast_reads(self) -> bool:
        """Whether its model and firmware know the fast reads."""
        ...

    def __getitem__(self, name: str) -> int:
        """The value of a register."""
        ...

    def read(self, address: int, length: int) -> bytes | None:
        """Bytes of the control table; None if they are not all in it."""
        ...

    def write(self, address: int, data: bytes, shadow: bool = False) -> int:
        """Writes bytes if every rule allows all of them; as a `shadow` it keeps its EEPROM as it is."""
        ...

    def register(self, address: int, data: bytes) -> int:
        """Keeps a write for `act`."""
        ...

    def act(self) -> int:
        """Carries out the write kept by `register`."""
        ...

    def reboot(self, deaf_until: float) -> None:
        """Restarts the servo."""
        ...

    def factory_reset(self, keep: int, deaf_until: float) -> bool:
        """Puts the EEPROM back to its defaults and restarts; whether `keep` is one of the known ways."""
        ...

    def clear(self) -> int:
        """Makes the present position one within a turn."""
        ...

    def back_up(self, restore: bool | None, deaf_until: float) -> int:
        """Stores the EEPROM, or restores it and restarts; None for neither, which is refused."""
        ...


class EmulatedServos(Protocol):
    """What is needed of the bus."""

    strict: bool
    time: float

    def hearing(self, id: int, family: Family) -> Iterable[EmulatedServo]:
        """The servos with this ID that hear, and speak as this family."""
        ...

    def shadows(self, id: int, family: Family) -> Iterable[EmulatedServo]:
        """Those with this second ID, to which they listen without answering."""
        ...

    def everybody(self, family: Family) -> Iterable[EmulatedServo]:
        """All of them, in no order."""
        ...

    def ids(self) -> list[int]:
        """Every ID that some servo has, in order."""
        ...

    def mixed(self, answers: list[Answer]) -> Answer:
        """Answers given at the same time, as they mix on the wire."""
        ...

    def reindex(self) -> None:
        """Updates which servo listens to which ID, after a change."""
        ...


class Answers(Protocol):
    """The module `answers` of a family."""

    def answer(self, bus: EmulatedServos, frame: Frame) -> list[Answer]:
        """The servos' answers to one instruction."""
        ...

    def damaged(self, bus: EmulatedServos, id: int) -> list[Answer]:
        """Their answers to a frame whose checksum was wrong."""
        ...


def answers_of(family: Family) -> Answers:
    """What answers the instructions of a family."""
    return cast(Answers, import_module(f"hardware.families.{family.name}.answers"))


def alone_or_mixed(bus: EmulatedServos, answers: list[Answer]) -> list[Answer]:
    """Answers of servos with the same ID, mixed into one where there are several."""
    return answers if len(answers) < 2 else [bus.mixed(answers)]


def sync_write(bus: EmulatedServos, family: Family, params: bytes) -> list[Answer]:
    """Carries out a sync write of `plain_frames`, which is unanswered."""
    if len(params) > 2 and params[1]:
        size = params[1] + 1
        for at in range(2, len(params) - size + 1, size):
            for device in bus.hearing(params[at], family):
                device.write(params[0], params[at + 1 : at + size])
        bus.reindex()
    return []
