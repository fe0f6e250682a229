"""Reading the maker's pages, and what is found where our tables differ."""

from pathlib import Path

import pytest

from benchmarks.rig.makers_tables import compare, model_of

HEAD = (
    "| Address | Size(Byte) | Data Name | Access | Initial<br />Value | Range | Unit |\n|:--|:--|:--|:--|:--|:--|:--|\n"
)
PAGE = f"""
> XC430-W150

{HEAD}| 12 | 1 | [Secondary(Shadow) ID](#id12) | RW | 255 | 0 ~ 252 | - |
| 20 | 4 | [Homing Offset](#homing) | RW | 0 | -1,044,479 ~<br>1,044,479 | 1 [pulse] |
| 31 | 1 | [Temperature Limit](#temperature) | RW | 80 | 0 ~ 100 | 1 [C] |
| 44 | 4 | [Velocity Limit](#velocity) | RW | 460 | 0 ~ 1,023 | 0.229 |
| … | … | … | … | … | - | - |

{HEAD}| 104 | 4 | [Goal Velocity](#goal) | RW | - | -Velocity Limit(44) ~<br> Velocity Limit(44) | 0.229 |
"""


def test_a_page_that_agrees_has_no_differences():
    assert list(compare("XC430-W150", PAGE)) == []


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("| 80 | 0 ~ 100", "| 75 | 0 ~ 100", ("XC430-W150", "temperature_limit", "default", 80, 75)),
        ("0 ~ 1,023", "0 ~ 2,047", ("XC430-W150", "velocity_limit", "range", (0, 1023), (0, 2047))),
        ("| 12 | 1", "| 17 | 1", ("XC430-W150", "at 17", "register", "none", 255)),
    ],
)
def test_each_difference_is_named(old, new, said):
    assert list(compare("XC430-W150", PAGE.replace(old, new))) == [said]


@pytest.mark.parametrize(
    ("page", "model"),
    [("xl330-m077", "XL330-M077"), ("mx-64", "MX-64(1.0)"), ("mx-64-2", "MX-64"), ("xl320", "XL-320"),
     ("ph54-200-s500-r", "PH54-200-S500"), ("h54-200-s500-ra", "H54-200-S500-RA"), ("protocol2", None)],
)  # fmt: skip
def test_a_page_is_known_by_its_name(page, model):
    assert model_of(Path(f"docs/{page}.md")) == model
