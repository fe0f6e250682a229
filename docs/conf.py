"""How Sphinx makes the site of these pages: `sphinx-build -W docs site`, or `sphinx-autobuild docs site` to read along.

The pages are Markdown that GitHub shows too, so what only the site needs is added while they are read: the tree of
pages (from the doors and lists of README.md), the references of commands (from the command line) and of the API (from
docstrings, a page a noun in reference/).
"""

from __future__ import annotations

import re
import shutil
import sys
import tomllib
from inspect import isclass
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
sys.path[:0] = [str(DOCS), str(DOCS.parent)]

from command_reference import command_reference  # noqa: E402

project = "Motiondeck"
release = version = tomllib.loads((DOCS.parent / "pyproject.toml").read_text())["project"]["version"]
root_doc = "README"
source_suffix = {".md": "markdown"}
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
copybutton_selector = (
    "div.highlight-sh pre, div.highlight-python pre, div.highlight-toml pre, div.highlight-default pre"
)
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
napoleon_use_ivar = True
default_role = "code"  # what stands between single backticks
html_theme = "furo"
html_title = f"Motiondeck {release}"
exclude_patterns = ["_build"]

LIST = re.compile(r"^(\w[\w ]+):\n\n((?:- .*\n)+)", re.M)
LINK = re.compile(r"\]\(([\w-]+)\.md\)")
PAGE_OF = {
    "live": "deck",
    "own_loop": "deck",
    "libraries": "library",
    "recordings": "recording",
    "robots": "robot",
    "rigs": "rig",
    "recognition": "recognizer",
    "errors": "errors",
    "networks": "networks",
    "reservoirs": "reservoirs",
    "centralized": "centralized",
}
REFERENCE = re.compile(r"\]\((reference/[\w-]+)\.md\)")
OUTSIDE = re.compile(r"\[([^\]]*)\]\(\.\./[^)]*\)")


# The robot on the first page. The player is that of today; the figure was written by `motiondeck export thesis15
# --robot servo20 --for web --out FOLDER --motions walk,slow-walk,jog,waltz,box1,cartwheel,getdown,crawl,standup`.
LIVE = """

Or play nine of the motions here, with nothing installed:

<iframe src="live/index.html" title="nine motions on a robot, played here" loading="lazy"
  style="width: 100%; height: 600px; border: 1px solid #8884; border-radius: 8px"></iframe>
"""


def add_what_the_site_needs(app: Any, page: str, source: list[str]) -> None:
    """Completes README by the tree of pages, and the references by what they are of; unlinks files outside of docs/."""
    text = source[0]
    if page == root_doc:
        text = text.replace("\n\nPlay and", f"{LIVE}\nPlay and", 1)
        doors = "\n".join(line for line in text.splitlines() if line.startswith(("First", "| **")))
        for caption, pages in [("Start here", doors), *LIST.findall(text)]:
            text += f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n" + "\n".join(LINK.findall(pages)) + "\n```\n"
    if page in ("command-reference", "api-reference"):
        text += "\n```{toctree}\n:hidden:\n\n" + "\n".join(REFERENCE.findall(text)) + "\n```\n"
    if page.startswith("reference/command-"):
        text += command_reference(page.partition("-")[2])
    elif page.startswith("reference/"):
        text += api_reference(page.partition("/")[2])
    source[0] = OUTSIDE.sub(r"\1", text)


def api_reference(noun: str) -> str:
    """Markdown that has autodoc write down each public name of a noun, as `nouns` has them."""
    parts: list[str] = []
    for name in nouns()[noun]:
        found: Any = getattr(sys.modules[name.rpartition(".")[0]], name.rpartition(".")[2])
        kind = "class" if isclass(found) else "function" if callable(found) else "data"
        members = "\n   :members:" if isclass(found) and not issubclass(found, BaseException) else ""
        parts.append(f"\n```{{eval-rst}}\n.. auto{kind}:: {name}{members}\n```\n")
    return "\n".join(parts)


def nouns() -> dict[str, list[str]]:
    """The public names by the page of reference/ that describes them, which follows from the module they come from."""
    import motiondeck
    import motiondeck.networks

    pages: dict[str, list[str]] = {page: [] for page in dict.fromkeys(PAGE_OF.values())}
    for home, names in motiondeck._HOMES.items():
        pages[PAGE_OF[home.rpartition(".")[2]]] += [f"motiondeck.{name}" for name in names.split()]
    for name in sorted(motiondeck.networks.__all__, key=lambda name: (not name.isupper(), name)):
        home = getattr(getattr(motiondeck.networks, name), "__module__", "controller.networks.reservoirs").split(".")
        page = next((part for part in ("reservoirs", "centralized") if part in home), "networks")
        pages[page].append(f"motiondeck.networks.{name}")
    return pages


def escape_docstring(app: Any, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Keeps signs of reStructuredText in a docstring, which is plain text, from meaning anything: |x| is a norm."""
    lines[:] = [re.sub(r"([|*]|\b_(?=\W|$))", r"\\\1", line) for line in lines]


def copy_first_page(app: Any, error: Exception | None) -> None:
    """Makes README.html the page that a web server shows first, and adds what plays on it."""
    if error is None and app.builder.format == "html":
        from motiondeck.export.web_page import copy_player

        shutil.copy(Path(app.outdir, "README.html"), Path(app.outdir, "index.html"))
        copy_player(Path(app.outdir, "live"))
        shutil.copy(DOCS / "live/figure.js", Path(app.outdir, "live"))


def setup(app: Any) -> None:
    """Registers the steps above."""
    app.connect("autodoc-process-docstring", escape_docstring, priority=100)  # before napoleon
    app.connect("source-read", add_what_the_site_needs)
    app.connect("build-finished", copy_first_page)
