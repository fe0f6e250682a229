"""The recipe of docs/deck.md that moves a jaw to a voice, with a voice of whose loudness is known."""

import re
import subprocess
import time
import wave
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import motiondeck
from command_line import motiondeck as command
from controller.wire.messages.commands import SetInput
from controller.wire.run_recording import load_recording

ROOT = Path(__file__).parents[2]
(RECIPE,) = re.findall(r"```python\n(import subprocess.*?)```", (ROOT / "docs" / "deck.md").read_text(), re.DOTALL)


def loudness(t):
    """Three syllables in two seconds, of different loudness."""
    size = np.select([t < 0.5, t < 1.2, t < 1.8], [0.4, 1.0, 0.7])
    return (
        size * np.sin(np.pi * np.select([t < 0.5, t < 1.2, t < 1.8], [t / 0.5, (t - 0.5) / 0.7, (t - 1.2) / 0.6])) ** 2
    )


def write_voice(file, channels):
    t = np.arange(2 * 16000) / 16000
    samples = (20000 * loudness(t) * np.sin(2 * np.pi * 200 * t)).astype("<i2")
    with wave.open(str(file), "wb") as sound:
        sound.setnchannels(channels)
        sound.setsampwidth(2)
        sound.setframerate(16000)
        sound.writeframes(np.repeat(samples, channels).tobytes())


class Follower:
    """Stands in for a live deck, and for the program that plays sound."""

    def __init__(self):
        self.values, self.sounds, self.waits = [], [], 1

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def status(self):
        self.waits -= 1
        return SimpleNamespace(at=0.0 if self.waits >= 0 else 0.2)

    def set_input(self, name, value):
        SetInput(name, value).check()
        assert name == "jaw"
        self.values.append(value)

    def sound(self, words):
        self.sounds.append((len(self.values), words))


@pytest.mark.parametrize("channels", [1, 2])
def test_the_values_are_the_loudness_of_the_voice(tmp_path, monkeypatch, channels):
    write_voice(tmp_path / "hello.wav", channels)
    monkeypatch.chdir(tmp_path)
    deck = Follower()
    monkeypatch.setattr(motiondeck, "play", lambda *_, **__: deck)
    monkeypatch.setattr(subprocess, "Popen", deck.sound)
    monkeypatch.setattr(time, "sleep", lambda _: None)
    exec(RECIPE, {})
    wanted = loudness((np.arange(100) + 0.5) / 50)
    assert len(deck.values) == 100
    assert deck.values == pytest.approx(np.minimum(wanted / np.percentile(wanted, 95), 1.0), abs=0.05)
    assert deck.sounds == [(3, ["aplay", "-q", "hello.wav"])]


@pytest.mark.thorough
@pytest.mark.timeout(400)
def test_the_jaw_of_the_head_opens_with_the_voice_while_it_looks_around(tmp_path, monkeypatch):
    head = ROOT / "examples" / "head"
    said = command("learn", head / "look.toml", "--out", tmp_path / "faces.safetensors")
    assert said.returncode == 0, said.stderr
    write_voice(tmp_path / "hello.wav", 1)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(subprocess, "Popen", real_but_silent(subprocess.Popen))
    recipe = RECIPE.replace(
        '"emulated:head.toml"', f'"emulated:{head / "head.toml"}", record="run.rec", command_port=0'
    )
    exec(recipe + "    time.sleep(2.5)\n", {})
    run = load_recording(tmp_path / "run.rec")
    playing = run.fields["approaching"][:, 0] == 0.0
    jaw, pan = (run.fields["targets"][playing, run.description["joints"].index(name)] for name in ("jaw", "neck_pan"))
    t, clock = np.arange(0.0, 2.0, 0.005), run.fields["clock_s"][playing, 0]  # ticks may be missing on a busy machine
    every = np.interp(np.arange(clock[0], clock[-1], 0.005), clock, jaw)
    heard = np.minimum(loudness(t) / np.percentile(loudness(t), 95), 1.0)
    shifts = [np.corrcoef(heard, every[shift : shift + len(t)])[0, 1] for shift in range(len(every) - len(t))]
    assert max(shifts) > 0.97
    assert jaw.max() == pytest.approx(0.6, abs=0.05)
    assert jaw[-50:] == pytest.approx(0.0, abs=0.01)  # it fell back: `look` keeps the jaw closed
    assert np.ptp(pan) > 0.2


def real_but_silent(real):
    """Starts programs but for aplay."""
    return lambda words, *more, **options: None if words[0] == "aplay" else real(words, *more, **options)
