"""Films and pictures of blends: what is commanded is played, what no film can show is refused; failing motions."""

from dataclasses import replace

import msgspec
import pytest

from controller.deck.deck import Deck
from controller.library.motion_library import load_library
from controller.wire.messages.commands import Blend, SetTempo
from motiondeck.cli.play import name_failing, play
from motiondeck.pictures import library_pictures
from motiondeck.run.spec.program import Program, Timed
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import shipped_configs


@pytest.fixture(scope="module")
def library():
    return load_library(shipped_configs() / "libraries" / "thesis15.safetensors")


@pytest.fixture
def filmed(library, monkeypatch):
    """Films a timeline that begins with walk; the deck afterwards, and the report."""
    monkeypatch.setattr(
        library_pictures, "film_frames", lambda model, frames, total, out, look: {"frames": len(list(frames))}
    )

    def film(timeline, seconds, out):
        decks = []
        monkeypatch.setattr(library_pictures, "Deck", lambda *of, **more: decks.append(Deck(*of, **more)) or decks[0])
        out.touch()
        look = library_pictures.film_look(out, None, None, "follow")
        spec = RunSpec(physics=False)
        program = Program(library, out, "walk", timeline, seconds)
        return library_pictures.film_run(spec, program, out, look)[0], decks[0]

    return film


def test_a_blend_and_a_tempo_are_filmed(filmed, tmp_path):
    timeline = [Timed(0.0, Blend("walk", "jog", 0.2)), Timed(0.1, SetTempo(0.9))]
    report, deck = filmed(timeline, 0.8, tmp_path / "blend.gif")
    assert report == {"frames": 16, "fell_back": ""}
    assert deck.blend == (("jog", 0.2),)
    assert deck.tempo == pytest.approx(0.9)


def test_a_command_that_the_deck_refuses_ends_the_film(filmed, tmp_path):
    with pytest.raises(MotiondeckError, match=r"at 0.1 s was refused: standup is a one-shot"):
        filmed([Timed(0.1, Blend("walk", "standup", 0.5))], 0.4, tmp_path / "film.gif")


def test_the_look_of_a_film_is_checked_before_it_is_made(tmp_path):
    mp4 = library_pictures.film_look(tmp_path / "a.mp4", None, None, "three")
    assert (mp4.size, mp4.fps, mp4.camera) == ((1920, 1080), 30.0, "three")
    assert library_pictures.film_look(tmp_path / "a.mp4", "640x480", 25.0, "side").size == (640, 480)
    for size, fps, camera, words in (
        ("big", None, "side", "WIDTHxHEIGHT"),
        (None, 0.0, "side", "--fps 0"),
        (None, None, "top", "camera 'top'"),
    ):
        with pytest.raises(MotiondeckError, match=words):
            library_pictures.film_look(tmp_path / "a.mp4", size, fps, camera)


def test_what_drives_no_deck_is_refused(tmp_path):
    script = tmp_path / "run.toml"
    script.write_text('motion = "walk"\n[[commands]]\nat = 1.0\nsay = "home"\n')
    with pytest.raises(MotiondeckError, match="at 1 s: 'home' is not for a film"):
        play(context=None, script=str(script), video=tmp_path / "film.mp4", mismatch_after=1.0)


def test_motions_that_failed_are_named_when_a_library_plays(library, capsys):
    motions = [
        msgspec.structs.replace(motion, passed=motion.name != "jog", reason="lost") for motion in library.info.motions
    ]
    name_failing(replace(library, info=msgspec.structs.replace(library.info, motions=motions)))
    assert (
        capsys.readouterr().err == "motiondeck: warning: jog (lost) failed the self-test and may not play as recorded\n"
    )
    name_failing(library)
    assert capsys.readouterr().err == ""
