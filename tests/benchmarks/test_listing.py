"""Every benchmark is listed with one line, takes --help, and what the pages tell to run exists."""

import re
from pathlib import Path

import pytest

from benchmarks.__main__ import find_benchmarks, first_line, main


def test_each_benchmark_is_listed_in_one_line_of_100_columns(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["benchmarks"])
    assert main() == 0
    shown = capsys.readouterr().out.splitlines()
    assert max(map(len, shown)) <= 100
    for name, file in find_benchmarks().items():
        assert any(line.startswith(f"  {name} ") for line in shown)
        assert first_line(file).endswith(".")
        assert "python -m" not in first_line(file)


def test_each_benchmark_reads_its_arguments_by_a_parser_with_help():
    for name, file in find_benchmarks().items():
        source = file.read_text()
        assert "ArgumentParser(" in source or f'run("{name}", ' in source, name


def test_an_unknown_benchmark_is_answered_with_the_list(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["benchmarks", "magic"])
    assert main() == 2
    assert "thesis" in capsys.readouterr().out


def test_a_mistake_of_the_user_ends_in_one_line(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("sys.argv", ["benchmarks", "vakulenko", str(tmp_path / "none.amc"), "segments"])
    assert main() == 1
    assert capsys.readouterr().err == f"benchmarks vakulenko: {tmp_path / 'none.amc'}: there is no such file\n"


PAGES = sorted(Path(__file__).parents[2].glob("docs/*.md"))


def told_commands(text):
    """The benchmarks that a page tells to run: name and options of each."""
    code = [
        *re.findall(r"`([^`]*)`", re.sub(r"```.*?```", "", text, flags=re.S)),
        *re.findall(r"^ {4}(.*)$", text, re.M),
    ]
    code += [line for block in re.findall(r"```\w*\n(.*?)```", text, re.S) for line in block.splitlines()]
    for words in (line.partition("#")[0].split() for line in code):
        if "benchmarks" in words[:-1] and "NAME" not in words:
            at = words.index("benchmarks") + 1
            yield words[at], [word.strip("[]") for word in words[at:] if word.strip("[").startswith("--")]


def test_the_pages_tell_of_every_kind_of_command():
    found = dict(told_commands("`python\n-m benchmarks a X --b 1`\n\n    python -m benchmarks c [--d]  # e\n"))
    assert found == {"a": ["--b"], "c": ["--d"]}
    assert {"networks", "recognition", "evaluation"} <= {
        page.stem for page in PAGES if [*told_commands(page.read_text())]
    }


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_benchmark_that_a_page_tells_to_run_exists_with_its_options(page):
    found = find_benchmarks()
    for name, options in told_commands(page.read_text()):
        assert name in found, f"{page.name}: there is no benchmark {name}"
        source = found[name].read_text()
        for option in options:
            parameter = option[2:].replace("-", "_")
            named = f'"{option}"' in source or re.search(rf"\b(no_)?{parameter.removeprefix('no_')}: ", source)
            assert named or option == "--jobs", f"{page.name}: {name} has no {option}"
