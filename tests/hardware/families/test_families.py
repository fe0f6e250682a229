"""A servo family is one folder: nothing outside it names its models or its protocol."""

import re
from pathlib import Path

import pytest

from hardware.families.models import FAMILIES, MODELS, TRAITS

ROOT = Path(__file__).parents[3]
NAMES = re.compile(
    "|".join(
        [
            *(rf"\b{re.escape(model)}" for model in MODELS),
            *(rf"\b{family.name}\b" for family in FAMILIES),
            r"\bprotocol ?[12]\b",
            r"\bProtocol [12]\.0",
        ]
    )
)


@pytest.mark.parametrize("package", ["hardware", "motiondeck"])
def test_nothing_outside_the_families_names_a_model_a_family_or_a_protocol(package):
    files = [file for file in (ROOT / package).rglob("*.py") if "families" not in file.parts]
    found = [
        f"{file.relative_to(ROOT)}: {line.strip()}"
        for file in files
        for line in file.read_text().splitlines()
        if NAMES.search(line)
    ]
    assert found == []


def test_every_family_is_found_and_has_models_and_answers():
    assert {family.name for family in FAMILIES} == {"dynamixel1", "dynamixel2", "feetech"}
    for family in FAMILIES:
        folder = ROOT / "hardware" / "families" / family.name
        assert (folder / "answers.py").is_file()
        assert any(traits.series.family is family for traits in TRAITS.values())


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_a_frame_of_each_instruction_is_found_by_its_own_parser(family):
    words = family.instructions
    frames = [
        words.ping(3),
        words.read(3, 10, 4),
        words.write(3, 10, b"\xff\xff\xfd"),
        words.sync_write(10, 1, b"\3\1"),
    ]
    found = family.parser().feed(b"".join(frames))
    assert [frame.id for frame in found] == [3, 3, 3, 254]
