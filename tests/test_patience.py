"""No test depends on how soon a thread or a process gets a core: what may be late is awaited, and for long."""

import ast
import time
from pathlib import Path

import pytest

from waiting import quick

CLOCKS = {"monotonic", "perf_counter", "process_time", "time"}
# Read at once, a page may not show yet what a message brings that comes after another.
READ_AT_ONCE = {"is_visible", "is_hidden", "is_enabled", "is_disabled", "is_checked", "inner_text", "text_content"}
READ_AT_ONCE |= {"input_value", "get_attribute", "all_inner_texts"}
SHORTEST = 20.0  # s


def hasty(text):
    """The lines that fail a busy machine: durations that have to be short, short waits, pages that are read at once."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Assert):
            if any(_reads_at_once(one) for one in ast.walk(node.test)):
                yield node.lineno
            limits = [one for one in ast.walk(node.test) if isinstance(one, ast.Lt | ast.LtE)]
            spans = [one for one in ast.walk(node.test) if isinstance(one, ast.BinOp) and isinstance(one.op, ast.Sub)]
            if limits and any(_is_clock(one.left) for one in spans):
                yield node.lineno
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            waits = [word.value for word in node.keywords if word.arg in ("timeout", "timeout_s")]
            waits += node.args if node.func.attr == "join" else []
            numbers = [one.value for one in waits if isinstance(one, ast.Constant)]
            if any(isinstance(number, int | float) and 0.1 < number < SHORTEST for number in numbers):
                yield node.lineno


def _is_clock(node):
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in CLOCKS


def _reads_at_once(node):
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
        return False
    return node.func.attr in READ_AT_ONCE or (node.func.attr == "count" and not node.args)


FILES = sorted(file for file in Path(__file__).parent.rglob("*.py") if file.parent.name != "__pycache__")


def test_no_test_is_hasty():
    found = [f"{file}:{line}" for file in FILES for line in hasty(file.read_text(encoding="utf-8"))]
    assert found == []


@pytest.mark.parametrize(
    "line",
    [
        "assert time.monotonic() - began < 2.0",
        "thread.join(5.0)",
        "process.communicate(timeout=10)",
        "assert tab.locator('svg').count() == 8",
        "assert [tab.is_visible() for tab in tabs] == [True]",
    ],
)
def test_a_hasty_line_is_found(line):
    assert list(hasty(f"pass\n{line}\n")) == [2]


def test_what_is_quick_now_and_then_is_quick():
    seconds = iter([0.2, 0.2, 0.0])
    quick(lambda: time.sleep(next(seconds)), 0.1)
    assert next(seconds, None) is None
