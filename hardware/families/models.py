"""The servo models whose control tables are known, of all families: every folder beside this file is one."""

from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from pkgutil import iter_modules

import hardware.families
from hardware.families.facts import FamilyFacts
from hardware.families.family import Family
from hardware.families.table import ControlTable

_NAMES = [folder.name for folder in iter_modules(hardware.families.__path__) if folder.ispkg]
_FOUND: list[FamilyFacts] = [import_module(f"hardware.families.{name}.facts").FACTS for name in _NAMES]
# Those that tell a ping what they are come first.
_FACTS = sorted(_FOUND, key=lambda facts: not facts.family.identification.by_ping)

FAMILIES = tuple(facts.family for facts in _FACTS)
USUAL = FAMILIES[0]  # the family of a servo of which nothing is known
MAPPED_TO = _FACTS[0].table(next(iter(_FACTS[0].numbers())))
"""The table whose registers an emulator computes with, where a servo lacks them."""

TRAITS = {model: traits for facts in _FACTS for model, traits in facts.traits.items()}  # by model name
IDENTIFIED = {model: motor for facts in _FACTS for model, motor in facts.motors.items()}
"""Motors that were identified on real servos, by model name."""
OTHER_DEVICES = {number: device for facts in _FACTS for number, device in facts.others.items()}
"""By model number: the names of devices without a control table here, and why they cannot be joints of a rig."""
WHY_NO_JOINT: dict[str, str] = dict(OTHER_DEVICES.values())  # by name


class Models(Mapping[str, ControlTable]):
    """Control tables by model name; a table is made when it is first asked for."""

    def __getitem__(self, model: str) -> ControlTable:
        return _of_models()[model].table(model)

    def __iter__(self) -> Iterator[str]:
        return iter(_of_models())

    def __len__(self) -> int:
        return len(_of_models())


MODELS = Models()


def known_name(number: int, family: Family = USUAL) -> str | None:
    """The name of the model or device with this number in a family, or set to it; None where it is not known."""
    return _names(family).get(number)


def model_name(number: int, family: Family = USUAL) -> str:
    """The name of the model with this number in a family, or the number where it is not known."""
    return known_name(number, family) or f"model number {number}"


def another_number(number: int, family: Family) -> int:
    """The number of another model of a family; one more where it has none."""
    (facts,) = (facts for facts in _FACTS if facts.family is family)
    return next((other for other in facts.numbers().values() if other != number), number + 1)


@cache
def _of_models() -> dict[str, FamilyFacts]:
    return {model: facts for facts in _FACTS for model in facts.numbers()}


@cache
def _names(family: Family) -> dict[int, str]:
    (facts,) = (facts for facts in _FACTS if facts.family is family)
    set_to_it = _names(USUAL) if family.choice is not None and family is not USUAL else {}
    others = {number: name for number, (name, _) in facts.others.items()}
    return set_to_it | others | {number: model for model, number in facts.numbers().items()}
