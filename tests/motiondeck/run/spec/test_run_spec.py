"""Every option of a run stands once: what the command line and Python make of it."""

import inspect
from pathlib import Path

import msgspec
import pytest
import typer
from typer.testing import CliRunner

import motiondeck
from motiondeck.cli.run_options import with_run_options
from motiondeck.run.spec.run_spec import RunSpec, is_emulated, options
from motiondeck_base.errors import MotiondeckError


def typed(*words, names=()):
    """The spec that a command gets from these words."""
    app, got = typer.Typer(), []

    @app.command()
    @with_run_options(*names)
    def run(spec: RunSpec) -> None:
        got.append(spec)

    result = CliRunner().invoke(app, list(words))
    assert result.exit_code == 0, result.output
    return got[0]


def test_every_option_has_help_and_a_keyword_in_python():
    assert all(option.help for option in options().values())
    assert [*inspect.signature(motiondeck.play).parameters] == [*options()]


def test_words_become_the_spec():
    spec = typed("jog", "--kinematic", "--rig", "emulated", "--lock-to", "47810", "--output", "a", "--output", "b:c")
    assert (spec.motion, spec.physics, spec.rig, spec.lock_to) == ("jog", False, "emulated", "47810")
    assert spec.outputs == ("a", "b:c")


def test_the_command_line_has_its_own_defaults_for_ports():
    spec = typed()
    assert (spec.page_port, spec.command_port, spec.physics) == (8040, 47810, True)
    assert (RunSpec().page_port, RunSpec().command_port) == (None, 0)
    assert RunSpec(page=True).page_port == 0


def test_a_command_may_have_some_of_the_options():
    assert typed("--seconds", "2", names=("seconds",)) == RunSpec(seconds=2.0)


def test_it_travels_to_another_process_as_json():
    spec = RunSpec("my.safetensors", "walk", rig="emulated", page=8041, outputs=("log:x",), on_mismatch="stop")
    assert msgspec.json.decode(msgspec.json.encode(spec), type=RunSpec) == spec


@pytest.mark.parametrize(
    ("wanted", "says"),
    [
        ({"seconds": -1.0}, "--seconds -1 is not"),
        ({"mismatch_after": 0.0}, "--mismatch-after 0 is not"),
        ({"rate": float("inf")}, "rate is inf"),
        ({"motion": "walk", "script": "jog"}, "not both"),
        ({"physics": False, "walk": True}, "leave --kinematic"),
        ({"recognize": True, "recognizer": "r.safetensors"}, "leave one"),
        ({"follow_rig": "emulated"}, "--follow-rig needs --follow"),
        ({"listen": "0.0.0.0"}, "needs --token-file"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_loaded(wanted, says):
    with pytest.raises(MotiondeckError, match=says):
        RunSpec(**wanted).check()


@pytest.mark.parametrize(
    ("rig", "emulated"),
    [("emulated", True), ("emulated:pan-tilt", True), ("emulated-arm.toml", False), (Path("emulated/arm.toml"), False)],
)
def test_a_rig_file_whose_name_begins_like_emulated_servos_is_none_of_them(rig, emulated):
    assert is_emulated(rig) == emulated
