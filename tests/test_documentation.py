"""The pages: what they link exists, docs/README.md links them all, and the source distribution holds what they show."""

import re
import runpy
import shlex
import statistics
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path
from urllib.parse import unquote

import pytest
import typer

import motiondeck
import motiondeck.networks
from motiondeck.cli.main import command_line
from motiondeck.libraries import load_library

ROOT = Path(__file__).parents[1]
TUTORIALS = ["README", "installation", "first-motion", "first-robot", "first-rig", "from-a-script", "cookbook"]
TUTORIALS += ["troubleshooting", "peers"]
PAGES = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "THIRD_PARTY_NOTICES.md", "CHANGELOG.md")]
PAGES += sorted((ROOT / "docs").glob("*.md"))
FOLDERS = ("motiondeck", "motiondeck_base", "controller", "sim", "hardware", "tests", "benchmarks", "examples", "docs")
SOURCES = [path.relative_to(ROOT).as_posix() for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
LINK = re.compile(r"\[[^\]\[]*\]\(([^)\s]+)\)")


def text_of(page):
    """A page without its blocks of code."""
    return re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)


def links(page):
    """The targets of a page's links and pictures within the project."""
    return [target for target in LINK.findall(text_of(page)) if not re.match(r"\w+:", target)]


def anchors(page):
    """The names under which a page's headings can be linked, as GitHub makes them."""
    headings = re.findall(r"^#+ +(.*?) *$", text_of(page), flags=re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_and_picture_exists(page):
    broken = []
    for target in links(page):
        file, _, anchor = target.partition("#")
        there = (page.parent / file).resolve() if file else page
        if not there.exists() or (anchor and anchor not in anchors(there)):
            broken.append(target)
    assert broken == []


def sentences(page):
    """The sentences of a page as lists of words, without tables and headings; what stands in backticks is one word."""
    prose = re.sub(r"^(    .*|\|.*|#.*|:::.*|<!--.*)$", "\n", text_of(page), flags=re.M)
    prose = re.sub(r"`[^`]*`", "code", re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", prose))
    for part in re.split(r"\n\s*\n|^\s*- ", prose, flags=re.M):
        for sentence in re.split(r"(?<=[.!?])[)\"*]*\s+(?=[\"(*A-Z]|code)", " ".join(part.split())):
            if words := re.findall(r"[A-Za-z][\w'’-]*", sentence):
                yield words


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_sentence_has_more_than_40_words(page):
    assert [" ".join(words) for words in sentences(page) if len(words) > 40] == []


@pytest.mark.parametrize(
    "pages", [TUTORIALS, [page.stem for page in (ROOT / "docs").glob("*.md")]], ids=["tutorials", "all"]
)
def test_half_of_the_sentences_have_at_most_15_words(pages):
    lengths = [len(words) for name in pages for words in sentences(ROOT / "docs" / f"{name}.md")]
    assert statistics.median(lengths) <= 15


@pytest.mark.parametrize("page", ["networks", "recognition", "evaluation"])
def test_every_table_of_figures_stands_below_the_command_that_makes_it(page):
    """Below the table before it, or in its section: a command, or options of the command of the section."""
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    without = []
    for section in re.split(r"^(?=#+ )", text, flags=re.M):
        above = 0
        for table in re.finditer(r"(?:^\|.*\n)+", section, flags=re.M):
            told = re.search(r"python\s+-m\s+benchmarks\s+\w+|\bmotiondeck\s+\w+|`--\w", section[above : table.start()])
            if len(re.findall(r"\d\.\d|\d %", table[0])) >= 3 and not told:
                without.append(table[0].partition("\n")[0])
            above = table.end()
    assert without == []


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "CHANGELOG.md"], ids=lambda page: page.name)
def test_every_module_that_a_page_names_exists(page):
    """By its path, or the end of it; the change log speaks of files that were."""
    named = set(re.findall(r"`([\w/]+\.py)`", text_of(page)))
    gone = {path for path in named if not any(f"/{file}".endswith(f"/{path}") for file in SOURCES)}
    assert gone == set()


def test_every_page_is_linked_from_the_first():
    linked = {target.partition("#")[0] for target in links(ROOT / "docs" / "README.md")}
    assert {page.name for page in (ROOT / "docs").glob("*.md")} - linked == {"README.md"}


def test_the_page_of_installation_names_every_extra_and_every_python_that_is_tested():
    page = (ROOT / "docs" / "installation.md").read_text(encoding="utf-8")
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    table = page.partition("| extra |")[2].partition("\n\n")[0]
    assert set(re.findall(r"^\| `(\w+)`", table, flags=re.M)) == set(extras)
    (tested,) = re.findall(r"python: \[(.*)\]", (ROOT / ".github/workflows/ci.yml").read_text())
    (first,) = re.findall(r"needs Linux and Python (.*?)\. ", page)
    assert re.findall(r"[\d.]+", first) == re.findall(r"[\d.]+", tested)


def test_the_page_of_troubleshooting_has_the_messages_of_today():
    """Made by its script, which refuses an entry whose words no message of the product has any more."""
    script = runpy.run_path(str(ROOT / "docs" / "troubleshooting.py"))
    assert (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8") == script["troubleshooting"]()
    with pytest.raises(ValueError, match="no message"):
        script["whole"]("the servo has a headache", list(script["messages"]()))


def test_every_public_name_has_one_page_of_the_reference():
    pages = runpy.run_path(str(ROOT / "docs" / "conf.py"))["nouns"]()
    described = [name.rpartition(".")[2] for names in pages.values() for name in names]
    assert sorted(described) == sorted({*motiondeck.__all__, *motiondeck.networks.__all__} - {"networks"})
    index = (ROOT / "docs" / "api-reference.md").read_text(encoding="utf-8")
    for page, names in pages.items():
        (row,) = re.findall(rf"\(reference/{page}\.md\) \|(.*)\|$", index, flags=re.M)
        assert re.findall(r"`(\w+)`", row) == [name.rpartition(".")[2] for name in names]


def test_every_command_has_one_page_of_the_reference():
    pages = runpy.run_path(str(ROOT / "docs" / "command_reference.py"))["nouns"]()
    index = (ROOT / "docs" / "command-reference.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"\(reference/command-(\w+)\.md\) \|(.*)\|$", index, flags=re.M))
    named = {page: re.findall(r"`([\w -]+)`", row) for page, row in rows.items()}
    assert named == {page: [words.partition(" ")[2] for words, _ in found] for page, found in pages.items()}
    assert all((ROOT / "docs" / "reference" / f"command-{page}.md").is_file() for page in pages)


def test_the_gallery_shows_every_motion_of_every_shipped_library():
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    for file in (ROOT / "configs" / "libraries").glob("*.safetensors"):
        for motion in load_library(file).motions:
            assert f"(pictures/gallery/{file.stem}-{motion}.webp)" in page
    assert sum(file.stat().st_size for file in (ROOT / "docs/pictures").rglob("*") if file.is_file()) < 3e6


def test_the_notices_name_every_shipped_library():
    shipped = {file.stem for file in (ROOT / "configs" / "libraries").glob("*.safetensors")}
    notices = (ROOT / "THIRD_PARTY_NOTICES.md").read_text(encoding="utf-8")
    assert len(shipped) >= 2
    assert {name for name in shipped if f"`{name}`" not in notices} == set()


def command_lines(page):
    """The command lines of `motiondeck` in a page: of its blocks of code, and those between backticks."""
    text = page.read_text(encoding="utf-8")
    blocks = "\n".join(re.findall(r"^```sh\n(.*?)^```", text, flags=re.M | re.S)).replace("\\\n", " ")
    written = re.findall(r"(?:^|[;&] )(?:\.venv/bin/)?motiondeck ([^#;&|>\n]*)", blocks, flags=re.M)
    written += re.findall(r"^    (?:\$ )?motiondeck ([a-z][^#;&|>\n]*)", text_of(page), flags=re.M)
    written += re.findall(r"`motiondeck ([a-z][^`\n]*)`", text_of(page))
    # Headings that name several commands, or what is to be given, are no command lines.
    return [line for line in written if not re.search(r"[|{\[]|\.\.\.|\b[A-Z]{2,}\b", line)]


@pytest.fixture(scope="module")
def program():
    return typer.main.get_command(command_line())


def misunderstood(program, words):
    """What the program finds wrong with the words of a command line, which is not run; nothing if it is right."""
    command, words = program, [word for word in words if word != "--debug"]
    while hasattr(command, "commands"):
        if not words:
            return ""
        if words[0] not in command.commands:
            return f"there is no command {words[0]}"
        command, words = command.commands[words[0]], words[1:]
    try:
        if words:
            command.make_context(command.name, words)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_line_is_one_that_the_program_understands(program, page):
    wrong = {line: misunderstood(program, shlex.split(line)) for line in command_lines(page)}
    assert {line: problem for line, problem in wrong.items() if problem} == {}


def test_the_page_of_commands_describes_every_command(program):
    """In a section whose heading names it or its group."""
    sections = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8").split("\n## ")
    missing = []
    for name, command in program.commands.items():
        own = "\n".join(one for one in sections if re.search(rf"`motiondeck {name}\b", one.partition("\n")[0]))
        parts = getattr(command, "commands", [name])
        missing += [f"{name}: {part}" for part in parts if not re.search(rf"\b{part}\b", own)]
    assert missing == []


@pytest.fixture(scope="module")
def packed(tmp_path_factory):
    """The names in the source distribution."""
    pytest.importorskip("hatchling", reason="the source distribution is built without the network")
    folder = tmp_path_factory.mktemp("sdist")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(folder)],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (archive,) = folder.glob("*.tar.gz")
    with tarfile.open(archive) as tar:
        return {name.partition("/")[2] for name in tar.getnames()}


def absent(paths, packed):
    """The files and folders that are not in the source distribution."""
    return {path for path in paths if path not in packed and not any(name.startswith(f"{path}/") for name in packed)}


@pytest.mark.thorough
def test_the_source_distribution_holds_what_the_pages_show(packed):
    shown = {page.relative_to(ROOT).as_posix() for page in PAGES}
    for page in PAGES:
        files = {target.partition("#")[0] for target in links(page)} - {""}
        shown |= {(page.parent / file).resolve().relative_to(ROOT).as_posix() for file in files}
    assert absent(shown, packed) == set()


@pytest.mark.thorough
def test_the_source_distribution_holds_each_path_that_the_readme_mentions(packed):
    words = re.findall(
        r"[\w.\-/]+", "\n".join(re.findall(r"`+[^`]+`+", (ROOT / "README.md").read_text(encoding="utf-8")))
    )
    folders = {path.name for path in ROOT.iterdir() if path.is_dir() and not path.name.startswith(".")}
    paths = {word.rstrip("/") for word in words if "/" in word and word.split("/")[0] in folders}
    assert "configs/libraries/thesis15.toml" in paths
    assert absent(paths, packed) == set()


@pytest.mark.thorough
def test_the_source_distribution_holds_all_sources_and_tests(packed):
    kinds = {".py", ".toml", ".xml", ".safetensors", ".md", ".png", ".webp", ".gif"}
    folders = [
        "motiondeck",
        "motiondeck_base",
        "controller",
        "sim",
        "hardware",
        "configs",
        "tests",
        "benchmarks",
        "docs",
    ]
    files = {path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in kinds}
    assert {path.relative_to(ROOT).as_posix() for path in files} - packed == set()


def test_the_badges_are_true():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    badges = [
        unquote(badge).replace("_", " ") for badge in re.findall(r"shields\.io/badge/(.*?)-[0-9a-f]{6}\)", readme)
    ]
    about = project["project"]
    assert badges == [
        f"python-{about['requires-python'].replace('>=', '≥ ')}",
        f"licence-{about['license'].replace('-', '--')}",
        "types-pyright",
    ]
    assert "pyright" in (ROOT / ".ci" / "run").read_text()


def test_the_version_is_the_newest_in_the_change_log_and_that_of_the_arduino_library():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    first, newest, *_ = re.findall(r"^## (.*)$", changes, flags=re.M)
    assert first == "Unreleased"
    assert re.fullmatch(rf"{re.escape(version)} - \d{{4}}-\d\d-\d\d", newest)
    library = (ROOT / "motiondeck/export/arduino/library.properties").read_text(encoding="utf-8")
    assert f"\nversion={version}\n" in library
