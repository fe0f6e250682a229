"""Every benchmark is listed with one line, and takes --help."""

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
