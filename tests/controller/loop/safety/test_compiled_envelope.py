"""The safety envelope in C beside its twin in Python: both do the same, and in a doubt the twin is taken."""

import ctypes
import os
import shutil
import subprocess
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_safety_envelope import limit_sets, limits, target_sequences

from controller.deck.interfaces import JointLimits
from controller.loop.safety import compiled_envelope
from controller.loop.safety.compiled_envelope import SOURCE, CompiledEnvelope, load_compiled, safety_envelope, unfit
from controller.loop.safety.safety_envelope import SafetyEnvelope

DT = 0.005
FLOATS = ["-DREAL=float", *(f"-D{name}={name.lower()}f" for name in ("SQRT", "CEIL", "FLOOR", "COPYSIGN", "FABS"))]
FLOATS += ["-DROUNDING=1e-6f", "-DCHANGED=1e-6f", "-DFARTHEST=1e30f"]


@pytest.fixture(scope="module")
def compile_to(tmp_path_factory):
    """Compiles a text of envelope.c as an installation does; the path of the library."""
    if shutil.which("cc") is None and "MOTIONDECK_ALL_TESTS" not in os.environ:
        pytest.skip("there is no C compiler here")
    build = pytest.importorskip("hatch_build", reason="the build hook needs hatchling: pip install hatchling")
    folder = tmp_path_factory.mktemp("compiled")

    def compile_text(text):
        source = folder / f"envelope-{zlib.crc32(text.encode())}.c"
        source.write_text(text)
        assert build.compile_envelope(source, source.with_suffix(".so")), "it does not compile"
        return source.with_suffix(".so")

    return compile_text


@pytest.fixture(scope="module")
def library(compile_to):
    found = load_compiled(compile_to(SOURCE.read_text()))
    assert found is not None
    return found


def assert_twins(library, limit, dt, start, targets, *, near=False):
    """Both emit the same, count the same and are in the same state, to the last bit, in every tick."""
    twins = SafetyEnvelope(limit, dt), CompiledEnvelope(library, limit, dt)
    for envelope in twins:
        envelope.start(start)
    for tick in range(len(targets) + 40):
        if tick == len(targets) // 2:
            for envelope in twins:
                envelope.restart(np.arange(len(start)) % 2 == 0, envelope.position)
        ours, theirs = (one(targets[tick], near) if tick < len(targets) else one.brake() for one in twins)
        assert ours.tobytes() == theirs.tobytes(), f"tick {tick}: {ours} {theirs}"
        assert np.array(twins[0]._states, dtype=float).tobytes() == np.array(twins[1]._states).tobytes(), f"tick {tick}"
    assert twins[0].changed == twins[1].changed
    assert twins[0].at_rest == twins[1].at_rest
    assert np.array_equal(twins[0].position, twins[1].position)


@settings(max_examples=12, deadline=None)
@given(limit_sets(), target_sequences(), st.sampled_from([0.001, 0.005, 0.02]), st.floats(0.0, 1.0), st.booleans())
def test_both_do_the_same_whatever_is_asked(library, limit, targets, dt, share, near):
    assert_twins(library, limit, dt, limit.lower + share * (limit.upper - limit.lower), targets, near=near)


def assert_twins_in(schedules, library, ticks):
    """In random schedules."""
    rng = np.random.default_rng(44)
    for _ in range(schedules):
        assert_twins_in_one(library, rng, ticks)


def assert_twins_in_one(library, rng, ticks):
    """Limits of 20 joints from sensible to absurd, and targets that wander, jump and now and then are no numbers."""
    joints = 20
    lower = rng.uniform(-3.0, 1.0, joints)
    span, *rates = (10.0 ** rng.uniform(*ends, joints) for ends in ((-3.0, 0.8), (-1.0, 1.5), (-0.5, 3.0), (0.0, 5.0)))
    wild = rng.normal(0.0, 10.0 ** rng.uniform(-2.0, 1.0), (ticks, joints))
    targets = np.where(rng.random((ticks, 1)) < rng.random(), np.cumsum(0.02 * wild, axis=0), wild)
    targets[rng.random(targets.shape) < 0.01] = rng.choice([np.nan, np.inf, -1e300])
    limit, dt, near = JointLimits(lower, lower + span, *rates), rng.choice([0.001, 0.005, 0.02]), rng.random() < 0.5
    assert_twins(library, limit, dt, lower, targets, near=near)


@pytest.mark.thorough
@pytest.mark.timeout(300)
def test_both_do_the_same_in_a_million_random_targets(library):
    assert_twins_in(100, library, 500)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("R(8.0) * size", "R(8.5) * size"),
        pytest.param(
            "least(most(curve, f), floored)",
            "most(most(curve, f), floored)",
            marks=pytest.mark.thorough,
        ),
        pytest.param("l->way <= room || ", "1 || ", marks=pytest.mark.thorough),
        pytest.param("R(2.0) * lag", "R(1.0) * lag", marks=pytest.mark.thorough),
        pytest.param("-R(FARTHEST) < target && ", "", marks=pytest.mark.thorough),
        pytest.param("v, a, s->p + v, v, R(1.0)", "v, a, s->p, v, R(1.0)", marks=pytest.mark.thorough),
        pytest.param("l->v + v), stop)", "l->v + v), low)", marks=pytest.mark.thorough),
        pytest.param("if (y_low >= R(0.0) || ", "if (", marks=pytest.mark.thorough),
        pytest.param("by <= R(CHANGED)", "by <= R(1e-3)", marks=pytest.mark.thorough),
    ],
)
def test_a_broken_source_is_noticed(compile_to, right, wrong):
    text = SOURCE.read_text()
    assert text.count(right) == 1
    library = ctypes.PyDLL(str(compile_to(text.replace(right, wrong))))
    with pytest.raises(AssertionError):
        assert_twins_in(20, library, 100)


def test_a_library_that_does_otherwise_than_its_twin_is_not_taken(compile_to, monkeypatch, tmp_path):
    broken = SOURCE.read_text().replace("R(8.0) * size", "R(8.5) * size")
    (tmp_path / "envelope.c").write_text(broken)
    monkeypatch.setattr(compiled_envelope, "SOURCE", tmp_path / "envelope.c")  # so that only the trial can tell
    assert load_compiled(compile_to(broken)) is None


def test_what_was_made_from_another_source_is_not_taken_and_named_with_the_remedy(compile_to, monkeypatch):
    for text, named in ((SOURCE.read_text() + "/* newer */\n", True), (SOURCE.read_text(), False)):
        monkeypatch.setattr(compiled_envelope, "COMPILED", compile_to(text))
        assert (load_compiled(compiled_envelope.COMPILED) is None) == named
        assert ["pip install -e ." in line for line in unfit()] == [True] * named


def test_an_installation_without_a_compiler_compiles_nothing(compile_to, monkeypatch, tmp_path):
    import hatch_build

    monkeypatch.setenv("PATH", str(tmp_path))
    assert not hatch_build.compile_envelope(SOURCE, tmp_path / "envelope.so")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", [None, b"", b"no library"])
def test_without_a_library_the_twin_does_the_work(tmp_path, monkeypatch, content):
    file = tmp_path / "envelope.so"
    if content is not None:
        file.write_bytes(content)
    monkeypatch.setattr(compiled_envelope, "COMPILED", file)
    assert type(safety_envelope(limits(2), DT)) is SafetyEnvelope
    assert len(unfit()) == (content is not None)


def test_targets_of_another_shape_are_refused_by_both(library):
    for envelope in (SafetyEnvelope(limits(2), DT), CompiledEnvelope(library, limits(2), DT)):
        for shape in (1, 3):
            with pytest.raises(ValueError):  # noqa: PT011 (zip says it in its own words)
                envelope(np.zeros(shape))


def test_an_output_cannot_change_what_the_next_one_is_given(library):
    shown = CompiledEnvelope(library, limits(2), DT)(np.zeros(2))
    with pytest.raises(ValueError, match="read-only"):
        shown[0] = 1.0


@pytest.mark.parametrize(
    "flags",
    [
        ["-x", "c", "-std=c99", "-pedantic"],
        ["-x", "c++", "-std=c++17"],
        ["-x", "c", "-std=c99", "-Wconversion", *FLOATS],
    ],
    ids=["C99", "C++17", "float"],
)
def test_it_compiles_without_a_warning(compile_to, flags):
    compiler = "c++" if "c++" in flags else "cc"
    command = [compiler, "-Wall", "-Wextra", "-Werror", "-Wdouble-promotion", *flags, "-fsyntax-only", SOURCE]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
