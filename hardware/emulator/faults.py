"""Fault injection for an emulated rig: kind, time, chance.

KIND[:key=value,...]     drop:id=3,chance=0.1     dead:id=5,at=2,for=1     unplug:at=4,for=1     latency:value=16
"""

import random
from collections.abc import Callable, Sequence
from typing import NamedTuple

from hardware.emulator.bus import BOOT_TIME, Answer, EmulatedBus
from hardware.emulator.servos.device import Device
from hardware.errors import MotiondeckError
from hardware.families.models import another_number

ON_ANSWERS = ("drop", "corrupt", "truncate", "delay")
ON_PORT = ("unplug", "latency")
KINDS = {
    "drop": "answers are lost (chance)",
    "corrupt": "a byte of an answer is damaged (chance)",
    "truncate": "answers break off (chance)",
    "delay": "answers come `value` ms late (5)",
    "dead": "a servo neither hears nor answers",
    "alert": "a servo reports hardware error bits `value` (1)",
    "overheat": "a servo heats up to `value` degC (90)",
    "brownout": "the supply falls to `value` V (4)",
    "reboot": "a servo restarts",
    "jam": "a servo's horn is blocked",
    "duplicate": "a servo takes the ID `value` of another",
    "swap": "a servo is replaced by one from the box, of model number `value` (another of its family)",
    "cells": "a servo's indirect cells are not where its table says, as with an unknown firmware",
    "unplug": "the adapter is pulled, and plugged in again when the time is over",
    "latency": "the USB adapter hands over every `value` ms only (16)",
}
_KEYS = ("id", "at", "for", "chance", "value")


class Fault(NamedTuple):
    """One fault."""

    kind: str
    id: int | None = None  # of the servo; None for any
    at: float = 0.0  # when it begins, s since the rig was switched on
    lasts: float = float("inf")  # for how long, s
    chance: float = 1.0  # for a fault on answers, the part of them that it meets
    value: float | None = None  # as in the kind's description; None for its default


def parse_fault(text: str) -> Fault:
    """Reads a fault from words as in the module's first lines; a MotiondeckError names what is allowed."""
    kind, _, rest = text.partition(":")
    if kind not in KINDS:
        raise MotiondeckError(f"no fault '{kind}'. There are: {', '.join(KINDS)}.")
    values: dict[str, float] = {}
    for pair in filter(None, rest.split(",")):
        key, _, value = pair.partition("=")
        try:
            if key not in _KEYS:
                raise ValueError
            values[key] = float(value)
        except ValueError:
            raise MotiondeckError(f"fault '{text}': '{pair}' is not {', '.join(k + '=N' for k in _KEYS)}.") from None
    if kind in ("jam", "duplicate", "swap", "reboot", "dead", "alert", "overheat") and "id" not in values:
        raise MotiondeckError(f"fault '{text}' needs the servo it is about: {kind}:id=NUMBER.")
    id = int(values["id"]) if "id" in values else None
    lasts = values.get("for", float("inf"))
    return Fault(kind, id, values.get("at", 0.0), lasts, values.get("chance", 1.0), values.get("value"))


class FaultPlan:
    """Faults, and what they do to a bus while they last."""

    def __init__(self, faults: Sequence[Fault] = (), seed: int = 0) -> None:
        self._faults = sorted(faults, key=lambda fault: fault.at)
        self._random = random.Random(seed)
        self._coming = list(self._faults)
        self._active: list[Fault] = []
        self._ids: Sequence[int] = ()
        self._undo: dict[tuple[str, int], Callable[[], None]] = {}  # by kind and servo
        self.unplugged = False  # whether the adapter is out
        self.latency = 0.0  # of the adapter, s

    def check(self, ids: Sequence[int]) -> None:
        """Takes the servos' first IDs, which the faults go by; MotiondeckError if a fault is about none of them."""
        self._ids = ids
        for fault in self._faults:
            if fault.id is not None and fault.id not in ids:
                raise MotiondeckError(f"fault {fault.kind}: there is no id {fault.id} on this rig (ids: {list(ids)}).")

    def advance(self, bus: EmulatedBus, now: float) -> None:
        """Begins and ends what is due at the time `now`, s."""
        for fault in [fault for fault in self._active if now >= fault.at + fault.lasts]:
            self._active.remove(fault)
            going_on = {key for other in self._active if other.kind == fault.kind for key in self._keys(other)}
            for key in self._keys(fault):
                if key in self._undo and key not in going_on:
                    self._undo.pop(key)()
        while self._coming and self._coming[0].at <= now:
            fault = self._coming.pop(0)
            self._active.append(fault)
            self._begin(fault, bus, now)

    def mangle(self, answer: Answer) -> Answer | None:
        """An answer as it gets through; None if it does not."""
        for fault in self._active:
            if fault.kind not in ON_ANSWERS or (fault.id is not None and fault.id != answer.id):
                continue
            if self._random.random() >= fault.chance:
                continue
            place = self._random.randrange(len(answer.data))
            match fault.kind:
                case "drop":
                    return None
                case "truncate":
                    answer = answer._replace(data=answer.data[:place])
                    if not place:
                        return None
                case "corrupt":
                    damaged = bytearray(answer.data)
                    damaged[place] ^= 1 << self._random.randrange(8)
                    answer = answer._replace(data=bytes(damaged))
                case _:
                    late = (5.0 if fault.value is None else fault.value) * 1e-3
                    answer = answer._replace(delay=answer.delay + late)
        return answer

    def _keys(self, fault: Fault) -> list[tuple[str, int]]:
        """Kind and servo of all that a fault meets; the adapter counts as one servo more."""
        if fault.kind in ON_PORT:
            return [(fault.kind, len(self._ids))]
        return [(fault.kind, place) for place, id in enumerate(self._ids) if fault.id in (None, id)]

    def _begin(self, fault: Fault, bus: EmulatedBus, now: float) -> None:
        """Starts a fault, and keeps what undoes it where no fault of its kind has done it already."""
        if fault.kind in ON_ANSWERS:
            return
        for key in self._keys(fault):
            undo = self._strike_port(fault) if fault.kind in ON_PORT else _strike(fault, bus.devices[key[1]], bus, now)
            if undo is not None:
                self._undo.setdefault(key, undo)

    def _strike_port(self, fault: Fault) -> Callable[[], None]:
        if fault.kind == "unplug":
            self.unplugged = True
            return lambda: setattr(self, "unplugged", False)
        self.latency = (16.0 if fault.value is None else fault.value) * 1e-3
        return lambda: setattr(self, "latency", 0.0)


def _strike(fault: Fault, device: Device, bus: EmulatedBus, now: float) -> Callable[[], None] | None:
    drive, row, value = device.bank.drive, device.row, fault.value
    match fault.kind:
        case "dead":
            device.dead = True
            return lambda: setattr(device, "dead", False)
        case "alert":
            device.fail(1 if value is None else int(value))
        case "overheat":
            drive.temperature[row] = 90.0 if value is None else value
        case "brownout":
            before = float(drive.supply[row])
            drive.supply[row] = 4.0 if value is None else value
            return lambda: drive.supply.__setitem__(row, before)
        case "reboot":
            device.reboot(now + BOOT_TIME)
        case "jam":
            drive.jammed[row] = True
            return lambda: drive.jammed.__setitem__(row, False)
        case "swap":
            first = device["model_number"]
            other = another_number(first, device.family) if value is None else int(value)
            device.swap(other, fault.at + BOOT_TIME)
            return lambda: device.swap(first, fault.at + fault.lasts + BOOT_TIME)
        case "cells":
            device.hide_cells()
        case "duplicate":
            before_id = device.id
            device["id"] = int(value) if value is not None else min(d.id for d in bus.devices if d is not device)
            bus.reindex()

            def own_id_again() -> None:
                device["id"] = before_id
                bus.reindex()

            return own_id_again
    return None
