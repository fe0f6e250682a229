"""Writes troubleshooting.md from troubleshooting.toml and the product's own messages: python docs/troubleshooting.py"""

from __future__ import annotations

import ast
import html
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

PAGE = Path(__file__).with_name("troubleshooting.md")
ROOMS = ("controller", "sim", "hardware", "motiondeck", "motiondeck_base")
LONGEST = 220  # letters of a message that are shown
HEAD = """# Troubleshooting

<!-- made by troubleshooting.py from troubleshooting.toml -->

What people run into, why, and what helps. Messages are those of the program; `…` stands for a name or a number.
Search this page for three words of yours.

Every mistake ends in one line with the place and the remedy. `motiondeck --debug COMMAND` shows in addition where in
the source it was noticed. For a rig begin with `motiondeck rig doctor RIG`, for a recording with
`motiondeck clip show FILE`.
"""


def messages() -> Iterator[str]:
    """Every text in the source of the product, with what is put into it in braces."""
    for room in ROOMS:
        for file in sorted((PAGE.parents[1] / room).rglob("*.py")):
            nodes = list(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))
            parts = {id(part) for node in nodes if isinstance(node, ast.JoinedStr) for part in node.values}
            for node in nodes:
                if isinstance(node, ast.JoinedStr):
                    yield "".join(
                        f"{{{ast.unparse(part.value)}}}" if isinstance(part, ast.FormattedValue) else str(part.value)
                        for part in node.values
                        if isinstance(part, ast.FormattedValue | ast.Constant)
                    )
                elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in parts:
                    yield node.value


def whole(says: str, texts: list[str]) -> str:
    """The shortest message of the product that has these words, as it is shown; ValueError if there is none."""
    found = min((text for text in texts if says in text), key=len, default=None)
    if found is None:
        raise ValueError(f"no message of the product has the words: {says}")
    shown = re.sub(r"\{(?:[^{}]|\{[^{}]*\})*\}", "…", " ".join(found.split())).strip(" ;:")
    return shown if len(shown) <= LONGEST else f"{shown[:LONGEST].rpartition(' ')[0]} …"


def troubleshooting() -> str:
    """The page."""
    texts, page = list(messages()), HEAD
    for group in tomllib.loads(PAGE.with_suffix(".toml").read_text(encoding="utf-8")).values():
        page += f"\n## {group['title']}\n"
        for entry in group["entries"]:
            page += f"\n### {entry['symptom']}\n\n"
            if "says" in entry:
                page += f"> {html.escape(whole(entry['says'], texts), quote=False)}\n\n"
            page += f"{entry['cause']}\n\n**What helps.** {entry['remedy']}\n"
    return page


if __name__ == "__main__":
    PAGE.write_text(troubleshooting(), encoding="utf-8")
