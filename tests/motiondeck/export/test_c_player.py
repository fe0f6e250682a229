"""Test that the C player of exported figures does as the deck, keeps limits, and refuses what it cannot play."""

import re
import shutil
import subprocess
from dataclasses import astuple, replace
from functools import cache
from pathlib import Path
from random import Random
from tempfile import mkdtemp

import numpy as np
import pytest
from scipy.optimize import brentq

from benchmarks.export import _c_player as c_player
from benchmarks.export._c_player import (
    SANITIZED,
    CPlayer,
    beyond_limits,
    deck_plays,
    in_fixed_point,
    random_script,
    wide,
)
from benchmarks.export.envelope_twins import beyond_limits as excess_in_fixed_point
from benchmarks.export.envelope_twins import compiled_fixed
from command_line import motiondeck
from controller.deck.interfaces import JointLimits
from controller.deck.motion_generator import MotionGenerator
from controller.deck.tracks import playing_tracks
from controller.loop.safety.approach import Approach
from controller.wire.messages import commands
from joint_libraries import RATE, centralized_library, joint_library
from motiondeck.export import figure as figure_module
from motiondeck.export.c_folder import PLAYER, write_c
from motiondeck.export.cost import cost_on
from motiondeck.export.figure import figure_of
from motiondeck.export.golden import deck_trace
from motiondeck_base.errors import FileFormatError, MotiondeckError

pytestmark = pytest.mark.skipif(not (shutil.which("cc") and shutil.which("make")), reason="no C compiler, or no make")

JOINTS, TICKS = 4, 300
ONES = np.ones(JOINTS)
LIMITS = JointLimits(-1.2 * ONES, 1.1 * ONES, 3.0 * ONES, np.array([20.0, 40.0, 80.0, 160.0]), 2e3 * ONES)


@cache
def figure(seed=0):
    return figure_of(joint_library(JOINTS, seed), [f"joint{k}" for k in range(JOINTS)], LIMITS, 0.0 * ONES, 100.0)


@cache
def player(*flags, fixed=False):
    return CPlayer(Path(mkdtemp()), ("-DMD_MOST_LAYERS=16", *flags), fixed=fixed)


@pytest.mark.parametrize("seed", range(24))
def test_random_commands_lead_to_the_angles_of_the_deck(seed):
    rng, one = Random(seed), wide(figure(seed % 3))
    script = random_script(one, TICKS, rng, 20.0, layered=seed % 3 > 0)
    measured = np.array([rng.uniform(-0.5, 0.5) for _ in range(JOINTS)], dtype=np.float32).astype(float)
    deck, ours = deck_plays(one, script, TICKS, measured), player().trace(one, script, TICKS, measured)
    assert ours.accepted == deck.accepted
    assert np.abs(ours.safe - deck.safe).max() < 1e-3


@pytest.mark.parametrize("seed", range(100, 112))
def test_no_limit_is_broken_whatever_is_commanded(seed):
    rng, one = Random(seed), figure(seed % 3)
    script = random_script(one, 600, rng, 25.0, layered=seed % 2 == 1)
    measured = np.array([rng.uniform(-1.0, 1.0) for _ in range(JOINTS)], dtype=np.float32).astype(float)
    ours = player().trace(one, script, 600, measured)
    assert beyond_limits(one, measured, ours.safe) <= 0.0
    assert np.abs(np.diff(ours.safe, axis=0)).max() > 0.005


@pytest.mark.parametrize("fixed", [False, pytest.param(True, marks=pytest.mark.thorough)])
def test_beats_live_values_and_heartbeats_last_as_long_as_in_the_deck(fixed):
    """Sums of single ticks came to be off by some ms in half a minute."""
    beats = [(20 + 53 * beat, commands.GiveBeat(ago=0.0)) for beat in range(6)]
    held = [(300, commands.SetInput(name="joint1", value=0.4, seconds=30.0)), (310, commands.Heartbeat(within=32.0))]
    one, our = wide(in_fixed_point(figure()) if fixed else figure()), player(fixed=fixed)
    ours, deck = (plays(one, [*beats, *held], 3600, 0.0 * ONES) for plays in (our.trace, deck_plays))
    assert np.abs(ours.safe - deck.safe).max() < 3e-4
    assert np.ptp(deck.safe[-20:], axis=0).max() < 1e-6 < np.ptp(deck.safe[3440:3460], axis=0).max()


@pytest.mark.parametrize("fixed", [False, pytest.param(True, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("seed", range(6))
def test_blends_of_blends_their_tempos_and_their_ends_are_those_of_the_deck(seed, fixed):
    rng, one = Random(seed), wide(in_fixed_point(figure(seed)) if fixed else figure(seed))
    loops = [name for name in one.library.network.motions if name.startswith("loop")]
    script = [(10, commands.SetTempo(factor=round(rng.uniform(0.2, 2.5), 2)))]
    for tick in range(20, 900, 90):
        first, second = rng.sample(loops, 2)
        weight = rng.choice([0.0, 0.5, 1.0, round(rng.uniform(-0.3, 1.3), 2)])
        script += [(tick + rng.randrange(80), commands.Blend(first=first, second=second, weight=weight))]
        script += [(tick + 85, commands.Queue(to=rng.choice(loops)))] * (rng.random() < 0.2)
    ours, deck = (plays(one, script, 1000, 0.0 * ONES) for plays in (player(fixed=fixed).trace, deck_plays))
    assert ours.accepted == deck.accepted
    assert np.abs(ours.safe - deck.safe).max() < 1e-3


@pytest.mark.parametrize("fixed", [False, pytest.param(True, marks=pytest.mark.thorough)])
def test_where_motions_rest_the_place_of_entry_is_not_left_to_rounding(fixed, monkeypatch):
    """All places of a rest are alike; the deck and the player took one each."""
    resting, rng = joint_library(JOINTS, 3), Random(0)
    for name, frames in resting.network._of.items():
        moving = np.clip(2.0 * np.linspace(0.0, 1.0, len(frames)) - 0.5, 0.0, 1.0)[:, None]
        frames[:] = 0.2 + np.sin(np.pi * moving) ** 4 * (frames - 0.2) * name.startswith("loop")
    monkeypatch.setattr(figure_module, "MOST_BYTES", 700)  # less than a key a frame: places between keys are rounded
    still = figure_of(resting, [f"joint{k}" for k in range(JOINTS)], LIMITS, 0.0 * ONES, 100.0)
    one, loops = wide(in_fixed_point(still) if fixed else still), ["loop0", "loop1", "loop2"]
    ticks = np.cumsum([rng.randrange(99) for _ in range(60)]).tolist()
    script = [(tick, commands.Switch(to=rng.choice(loops))) for tick in ticks]
    ours, deck = (plays(one, script, 3000, 0.0 * ONES) for plays in (player(fixed=fixed).trace, deck_plays))
    assert np.abs(ours.safe - deck.safe).max() < 1e-3


@pytest.mark.parametrize("phase", [0.23, 0.24, 0.25])
def test_half_a_beat_off_the_way_round_is_not_left_to_rounding(phase):
    """Of a round of 1 s with two beats at whole ticks; it is that far off at a phase of 0.24."""
    beats = [(tick, commands.GiveBeat(ago=0.0)) for tick in (60, 110)]
    script = [(50, commands.LockPhase(source="beat", phase=phase, steps=2)), *beats]
    ours, deck = (plays(wide(figure(11)), script, 140, 0.0 * ONES) for plays in (player().trace, deck_plays))
    assert np.abs(ours.safe - deck.safe).max() < 1e-3


EITHER = pytest.mark.parametrize("fixed", [False, pytest.param(True, marks=pytest.mark.thorough)])


@cache
def of_lengths(*lengths):
    """A figure of loops of these numbers of frames, the last of a one-shot."""
    library = joint_library(JOINTS, 1, loops=len(lengths) - 1, shots=1, lengths=lengths)
    return figure_of(library, [f"joint{k}" for k in range(JOINTS)], LIMITS, 0.0 * ONES, 100.0)


def same(one, script, ticks, fixed):
    one = wide(in_fixed_point(one) if fixed else one)
    ours, deck = (plays(one, script, ticks, 0.0 * ONES) for plays in (player(fixed=fixed).trace, deck_plays))
    assert ours.accepted == deck.accepted
    return np.abs(ours.safe - deck.safe).max() < 1e-3


@EITHER
@pytest.mark.parametrize("late", [-6e-6, 6e-6])
def test_a_round_that_ends_a_hair_from_a_tick_ends_in_the_same_tick(late, fixed):
    tempo = (0.75 * 1.5 - late) / 1.2  # three quarters of a round in 120 ticks, and some us to come
    script = [(10, commands.SetTempo(factor=tempo)), (60, commands.Jump(phase=0.25)), (100, commands.Queue(to="loop1"))]
    assert same(of_lengths(180, 180, 150), script, 240, fixed)


@pytest.mark.thorough
@EITHER
@pytest.mark.parametrize(("tick", "tempo"), [(3000, 1.0), (3000, -1.0), (12000, 2.0)])
def test_after_minutes_a_round_still_ends_in_the_tick_of_the_deck(tick, tempo, fixed):
    """A round of 150 ticks came to end a tick later, since 32 bits had lost as much of each tick."""
    script = [(10, commands.SetTempo(factor=tempo)), (60, commands.Jump(phase=0.2)), (tick, commands.Queue(to="loop1"))]
    assert same(of_lengths(180, 150, 60), script, tick + 250, fixed)


@EITHER
def test_a_jump_to_halfway_between_frames_goes_to_the_same_one(fixed):
    jumps = [(30 * n, commands.Jump(phase=round(0.01 + 0.02 * n, 2))) for n in range(1, 49)]  # a frame and a half, ...
    assert same(of_lengths(150, 150), jumps, 1500, fixed)


@pytest.mark.thorough
@pytest.mark.parametrize("fixed", [False, True])
@pytest.mark.parametrize("lengths", [(120, 180), (180, 120), (60, 150), (150, 60)])
def test_two_loops_of_which_one_is_half_as_long_again_stay_in_step_alike(lengths, fixed):
    assert same(
        of_lengths(*lengths, 150), [(20, commands.Blend(first="loop0", second="loop1", weight=0.6))], 400, fixed
    )


@EITHER
def test_a_one_shot_does_not_choose_how_many_beats_a_round_has(fixed):
    beats = [(20 + 80 * beat, commands.GiveBeat(ago=0.0)) for beat in range(8)]
    script = [*beats, (420, commands.Switch(to="shot1"))]
    script += [(480, commands.Switch(to="loop0", direct=True))]
    assert same(of_lengths(150, 60), sorted(script, key=lambda row: row[0]), 650, fixed)


@pytest.mark.thorough
@EITHER
@pytest.mark.parametrize("tempo", [-3.0, 2.0, 3.0])
def test_a_long_loop_is_entered_as_much_further_on_as_its_search_took(tempo, fixed):
    script = [(10, commands.SetTempo(factor=tempo)), (200, commands.Switch(to="loop1"))]
    assert same(of_lengths(600, 600, 60), script, 400, fixed)


@EITHER
def test_a_layer_begins_as_soon_as_the_one_below_stands_still(fixed):
    """Of quick motions, whose shares come and go in whole steps: what rounding left of one took a tick."""
    quick, script = joint_library(JOINTS, 1, loops=2, shots=1, lengths=(120, 120, 60)), []
    for number, frames in enumerate(quick.network._of.values()):
        frames[:] = 0.1 * np.sin(0.1 * np.pi * np.arange(len(frames))[:, None] + np.arange(JOINTS) + number)
    for tick in range(20, 1500, 150):
        script += [(tick, commands.Layer(group="even", to="loop0", weight=0.9))]
        script += [(tick + 12 + tick // 100, commands.Layer(group="half", to="loop1", weight=0.5))]
        script += [(tick + 90, commands.Layer(group="off", to="loop0"))]
    one = figure_of(quick, [f"joint{k}" for k in range(JOINTS)], LIMITS, 0.0 * ONES, 100.0)
    assert same(one, script, 1600, fixed)


@EITHER
def test_a_stop_where_a_motion_rests_is_over_in_the_tick_of_the_deck(fixed):
    """What rounding left of the way back to where joints were took as long as a way."""
    library = joint_library(JOINTS, 1, loops=1, shots=1, lengths=(120, 60))
    library.network._of["shot1"][:] = np.linspace(1.0, 0.0, 60)[:, None] ** 3 + 0.0873 * np.eye(JOINTS)[0]
    one = figure_of(library, [f"joint{k}" for k in range(JOINTS)], LIMITS, 0.0 * ONES, 100.0)
    for tempo in (0.77, 1.3, 2.1):
        script = [(10, commands.SetTempo(factor=tempo)), (20, commands.Switch(to="shot1"))]
        script += [(300, commands.EmergencyStop()), (340, commands.Reset(code=0.0)), (350, commands.Switch(to="loop0"))]
        assert same(one, script, 450, fixed)


@EITHER
def test_numbers_at_the_ends_of_their_range_are_taken(fixed):
    ends = [
        *(commands.Blend(first="loop1", second="loop2", weight=weight) for weight in (-0.3, 1.3)),
        *(commands.SetTempo(factor=factor, over=over) for factor, over in ((-3.0, 60.0), (3.0, 0.0))),
        *(commands.LockPhase(source="beat", phase=phase, steps=steps) for phase, steps in ((0.0, 0), (1.0, 16))),
        *(commands.GiveBeat(ago=ago) for ago in (-2.0, 2.0)),
        *(commands.Layer(group="half", to="loop1", weight=w, tempo=t) for w, t in ((0.0, 0.0), (1.0, 3.0))),
        *(commands.SetInput(name="joint1", value=value, seconds=0.05) for value in (-1.0, 1.0)),
    ]
    one, script = wide(in_fixed_point(figure()) if fixed else figure()), [(50, end) for end in ends]
    assert player(fixed=fixed).trace(one, script, 60).accepted == [True] * len(ends)


def test_a_chain_of_blends_never_plays_more_motions_than_the_deck():
    library, script = joint_library(JOINTS, 0, loops=8, shots=1), [(20, commands.Switch(to="loop1"))]
    for number, tick in enumerate(range(220, 340, 20), 1):
        script.append((tick, commands.Blend(first=f"loop{number}", second=f"loop{number + 1}", weight=0.5)))
    one = wide(figure_of(library, [f"joint{k}" for k in range(JOINTS)], LIMITS, 0.0 * ONES, 100.0))
    ours, deck = (plays(one, script, 500, 0.0 * ONES) for plays in (player().trace, deck_plays))
    assert np.abs(ours.safe - deck.safe).max() < 1e-3


def test_numbers_out_of_their_range_are_refused_and_change_nothing():
    wrong = [
        *(commands.Blend(first="loop1", second="loop2", weight=weight) for weight in (-0.31, 1.31)),
        *(commands.SetTempo(factor=factor, over=over) for factor, over in ((-3.01, 0.0), (3.01, 0.0), (1.0, 60.1))),
        *(commands.Jump(phase=phase) for phase in (-0.01, 1.01)),
        *(commands.LockPhase(source="beat", phase=phase, steps=steps) for phase, steps in ((-0.01, 0), (0.5, 17))),
        *(commands.GiveBeat(ago=ago) for ago in (-2.01, 2.01)),
        *(
            commands.Layer(group="half", to="loop1", weight=w, tempo=t)
            for w, t in ((-0.01, 1.0), (1.01, 1.0), (0.5, 3.01))
        ),
        *(
            commands.SetInput(name="joint1", value=value, seconds=s)
            for value, s in ((-1.01, 1.0), (1.01, 1.0), (0.5, 0.04))
        ),
    ]
    ours = player().trace(wide(figure()), [(50, one) for one in wrong], 120)
    assert ours.accepted == [False] * len(wrong)
    assert np.array_equal(ours.safe, player().trace(wide(figure()), [], 120).safe)


@pytest.fixture
def impatient(tmp_path, monkeypatch):
    """A player, with a deck beside it, that gives up each blend, if it moves less than three times as far."""
    for source in PLAYER:
        text = source.read_text().replace("#define STILL 0.1f", "#define STILL 3.0f")
        (tmp_path / source.name).write_text(text.replace("#define TURNS_OVER 2.5f", "#define TURNS_OVER 0.8f"))
    (tmp_path / "built").mkdir()
    player()  # of the sources as they are
    monkeypatch.setattr(c_player, "PLAYER", [tmp_path / source.name for source in PLAYER])
    monkeypatch.setattr(playing_tracks, "STILL", 3.0)
    monkeypatch.setattr(playing_tracks, "TURNS_OVER", 0.8)
    return CPlayer(tmp_path / "built")


def test_a_blend_that_is_given_up_goes_on_as_in_the_deck(impatient):
    """No motion of the tests stands still in a blend."""
    pairs, rng = [("loop0", "loop1"), ("loop1", "loop2"), ("loop2", "loop1")], Random(0)
    ticks = np.cumsum([rng.randrange(20, 110) for _ in range(40)]).tolist()
    given = [(tick, pairs[min(n, rng.randrange(1, 3))], rng.choice([0.3, 0.45, 0.8])) for n, tick in enumerate(ticks)]
    script = [(at, commands.Blend(first=one, second=other, weight=share)) for at, (one, other), share in given]
    one = wide(figure(1))
    ours, deck = (plays(one, script, 2600, 0.0 * ONES) for plays in (impatient.trace, deck_plays))
    assert ours.accepted == deck.accepted
    assert np.abs(ours.safe - deck.safe).max() < 1e-3
    assert np.abs(deck.safe - player().trace(one, script, 2600, 0.0 * ONES).safe).max() > 0.05


@pytest.mark.parametrize("seed", range(4))
def test_a_blend_that_is_given_up_while_the_next_one_is_sought_goes_on_in_that(seed, impatient):
    """Of four loops: what the next blend had no part in took over, and weights of that did not sum to 1."""
    library, rng, script = joint_library(JOINTS, seed, loops=4, shots=0, lengths=[480] * 4), Random(seed), []
    for begin in range(20, 1600, 400):
        first, common, other = rng.sample(library.network.motions, 3)
        script += [(begin, commands.Switch(to=first, direct=True))]
        script += [(begin + 200, commands.Blend(first=first, second=common, weight=round(rng.uniform(-0.3, 0.4), 2)))]
        script += [(begin + rng.randrange(252, 262), commands.Blend(first=common, second=other, weight=1.2))]
    one = wide(figure_of(library, [f"joint{k}" for k in range(JOINTS)], LIMITS, 0.0 * ONES, 100.0))
    ours, deck = (plays(one, script, 1700, 0.0 * ONES) for plays in (impatient.trace, deck_plays))
    assert ours.accepted == deck.accepted
    assert np.abs(ours.safe - deck.safe).max() < 1e-3


def test_a_blend_is_the_mean_of_its_motions_in_step():
    one = wide(figure(1))
    names = [name for name in one.library.network.motions if name.startswith("loop")]
    script = [(50, commands.Blend(first=names[0], second=names[1], weight=0.3))]
    blended = player().trace(one, script, 700).safe[400:]
    # The common round takes the weighted geometric mean of both: as often as it fits, it begins anew.
    frames = [one.library.network[name].astype(float) for name in names[:2]]
    common = round(len(frames[0]) ** 0.7 * len(frames[1]) ** 0.3 / 1.2)
    assert np.abs(blended[common:] - blended[:-common]).max() < 0.02
    spectra = [np.fft.rfft(part, axis=0)[0].real / len(part) for part in frames]
    assert np.abs(blended[:common].mean(0) - 0.7 * spectra[0] - 0.3 * spectra[1]).max() < 0.01


FEW = [0, 1, 2, 4, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(5, 40))]


@pytest.mark.skipif(not shutil.which("c++"), reason="no C++ compiler")
@pytest.mark.parametrize("seed", FEW)
def test_in_fixed_point_commands_lead_to_the_angles_of_the_deck_and_no_limit_is_broken(seed):
    rng, one, flags = Random(seed), in_fixed_point(figure(seed % 3)), SANITIZED if seed > 4 else ()
    script = random_script(one, TICKS, rng, 20.0, layered=seed % 3 > 0)
    measured, checked = np.array([rng.uniform(-0.5, 0.5) for _ in range(JOINTS)]), player(*flags, fixed=True)
    deck, ours = deck_plays(wide(one), script, TICKS, measured), checked.trace(wide(one), script, TICKS, measured)
    assert ours.accepted == deck.accepted
    assert np.abs(ours.safe - deck.safe).max() < 3e-3
    limited = checked.trace(one, script, TICKS, measured)
    assert beyond_limits(one, measured, limited.safe) <= 0.0
    assert np.abs(np.diff(limited.safe, axis=0)).max() > 0.001


@pytest.mark.skipif(not shutil.which("c++"), reason="no C++ compiler")
@pytest.mark.parametrize("ticks", [6.9998, 7.0002, 10.0002])
def test_an_approach_in_fixed_point_takes_as_many_ticks_as_that_of_the_deck(ticks):
    one = wide(in_fixed_point(figure()))
    goal, side = deck_trace(one, [], 1, 0.0 * ONES).targets[0], np.eye(JOINTS)[1]

    def beyond(far):
        return Approach.within(one.limits, goal + far * side, goal).duration * one.rate - ticks

    start = goal + brentq(beyond, 1e-3, 1.0) * side
    ours, deck = (plays(one, [], 20, start) for plays in (player(fixed=True).trace, deck_plays))
    assert np.abs(ours.safe - deck.safe).max() < 1e-3


@pytest.mark.thorough
@pytest.mark.skipif(not shutil.which("c++"), reason="no C++ compiler")
def test_no_target_breaks_limits_in_fixed_point_and_a_broken_braking_law_is_found(tmp_path):
    program = compiled_fixed(tmp_path)
    assert max(excess_in_fixed_point(program, seed) for seed in range(8)) <= 0.0
    assert excess_in_fixed_point(compiled_fixed(tmp_path, broken=True), 0) > 0.0


@pytest.mark.thorough
@pytest.mark.skipif(not shutil.which("arm-none-eabi-g++"), reason="no compiler for a microcontroller")
def test_in_fixed_point_no_floating_point_is_left_for_a_core_without_it(tmp_path):
    write_c(in_fixed_point(figure()), tmp_path)
    words = ["arm-none-eabi-g++", "-mcpu=cortex-m0plus", "-mthumb", "-Os", "-fno-exceptions", "-c", "player.cpp"]
    subprocess.run(words, cwd=tmp_path, check=True)
    asked = subprocess.run(
        ["arm-none-eabi-nm", "-u", tmp_path / "player.o"], check=True, capture_output=True, text=True
    )
    assert "__aeabi_lmul" in asked.stdout
    assert "div" not in asked.stdout
    assert not re.search(r"__aeabi_[cdf]\w|__aeabi_\w+2[df]|\b(sqrtf|cbrtf|floorf|rintf)\b", asked.stdout)


@pytest.mark.thorough
@pytest.mark.skipif(not shutil.which("c++"), reason="no C++ compiler")
def test_a_folder_in_fixed_point_builds_and_its_golden_trace_passes(tmp_path):
    write_c(in_fixed_point(figure(1)), tmp_path)
    strict = "-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Werror -O1"
    subprocess.run(["make", "-C", tmp_path, f"CFLAGS={strict}"], check=True, capture_output=True)
    (tmp_path / "golden.h").write_text((tmp_path / "golden.h").read_text().replace("{60, 's'", "{66, 's'"))
    assert subprocess.run(["make", "-C", tmp_path], capture_output=True).returncode


def test_a_missed_heartbeat_pauses_and_a_given_one_does_not():
    one = wide(figure())
    beats = [(tick, commands.Heartbeat(within=0.2)) for tick in range(100, 180, 15)]
    deck = deck_trace(one, [*beats, (196, commands.Pause())], TICKS)
    assert np.abs(player().trace(one, beats, TICKS).safe - deck.safe).max() < 1e-3
    assert np.ptp(deck.safe[-30:], axis=0).max() < 1e-6


def test_after_a_missed_heartbeat_it_goes_on_whatever_the_tempo_was_on_its_way_to():
    one, still = wide(figure()), commands.SetTempo(factor=1.0, over=5.0)
    missed = [(90, still), (100, commands.Heartbeat(within=0.2)), (180, commands.Resume())]
    deck = deck_trace(one, [(90, still), (121, commands.Pause()), (180, commands.Resume())], TICKS)
    assert np.abs(player().trace(one, missed, TICKS).safe - deck.safe).max() < 1e-3
    assert np.ptp(deck.safe[-30:], axis=0).max() > 0.01


def test_a_folder_of_many_joints_builds_and_one_that_cannot_be_written_is_named(tmp_path):
    library, many = joint_library(40, loops=1, shots=0), np.ones(40)
    limits = JointLimits(-9.0 * many, 9.0 * many, 9.0 * many, 99.0 * many, 9e3 * many)
    one = figure_of(library, [f"joint{k}" for k in range(40)], limits, 0.0 * many, 100.0)
    write_c(one, tmp_path)
    subprocess.run(["make", "-C", tmp_path], check=True, capture_output=True)
    with pytest.raises(FileFormatError, match=r"player\.c/.*: cannot be written .*Check folder and free space"):
        write_c(one, tmp_path / "player.c")


@pytest.mark.thorough
def test_sanitizers_find_nothing_and_a_damaged_figure_is_refused():
    one, checked = figure(), player(*SANITIZED)
    script = random_script(one, 900, Random(5), 15.0, layered=True)
    assert np.array_equal(checked.trace(one, script, 900).safe, player().trace(one, script, 900).safe)
    for place in (0, 4, 5, 6, 7, 8, 40, 44, 48, 400, len(one.words) - 1):
        words = bytearray(one.words)
        words[place] ^= 20 if place == 6 else 4  # of the number of words: no word beyond them is read
        with pytest.raises(RuntimeError, match="md_begin: -1"):
            checked.trace(replace(one, words=bytes(words)), [], 1)


@pytest.mark.thorough
def test_the_folder_builds_without_a_warning_and_its_golden_trace_passes(tmp_path):
    write_c(figure(1), tmp_path)
    strict = "-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wdouble-promotion -Werror -ffp-contract=off -O2"
    subprocess.run(["make", "-C", tmp_path, f"CFLAGS=-std=c99 {strict}"], check=True, capture_output=True)
    (tmp_path / "golden.h").write_text((tmp_path / "golden.h").read_text().replace("{60, 's'", "{66, 's'"))
    assert subprocess.run(["make", "-C", tmp_path], capture_output=True).returncode
    for compiler in ("c++ -std=c++17 -x c++", "clang -std=c99", "clang++ -std=c++17 -x c++"):
        if shutil.which(compiler.split()[0]):
            subprocess.run([*compiler.split(), *strict.split(), "-fsyntax-only", tmp_path / "player.c"], check=True)


@cache
def centralized():
    return centralized_library(JOINTS)


def held(networks):
    joints = [f"joint{k}" for k in range(JOINTS + 1)]  # of which the last has no motion
    limits = JointLimits(*(np.append(one, one[-1]) for one in astuple(LIMITS)))
    return figure_of(centralized(), joints, limits, np.array([0.0] * JOINTS + [0.3]), 100.0, networks=networks)


@pytest.mark.parametrize("networks", [False, True])
def test_a_centralized_library_is_exported_as_its_network_plays_it(networks):
    one, library = held(networks), centralized()
    assert set(one.held.values()) == {"network" if networks else "keys"}
    for name in library.network.motions:
        played = MotionGenerator(library, name).frames(0.9, RATE)  # one without a phase begins a frame later
        found = MotionGenerator(one.library, name).frames(0.9, RATE)[1:]
        assert np.abs(found[:, :JOINTS] - played[:-1]).max() < 1e-3
        assert np.abs(found[:, JOINTS] - 0.3).max() < 1e-3


@pytest.mark.parametrize("seed", range(6))
def test_networks_are_evaluated_and_joined_as_the_deck_does(seed):
    one, rng = wide(held(True)), Random(seed)
    script = random_script(one, TICKS, rng, 25.0, layered=seed % 2 > 0)
    deck, ours = deck_plays(one, script, TICKS, one.rest), player().trace(one, script, TICKS, one.rest)
    assert ours.accepted == deck.accepted
    assert np.abs(ours.safe - deck.safe).max() < 1e-3


def test_a_network_that_does_not_come_near_enough_is_held_as_keys(monkeypatch):
    assert set(held(True).bytes_of) == set(centralized().network.motions)
    monkeypatch.setattr(figure_module, "MOST_CENTERS", 1)
    assert set(held(True).held.values()) == {"keys"}


def test_the_cost_is_what_a_compiler_finds_and_a_board_that_is_too_small_is_refused(tmp_path):
    one, size = figure(), tmp_path / "size.c"
    cost = cost_on(one, "M4F:64:64:256")
    size.write_text('#include "player.h"\n#include <stdio.h>\nint main(void) { printf("%zu", sizeof(md_player)); }\n')
    for source in PLAYER:
        shutil.copy(source, tmp_path)
    subprocess.run(["cc", f"-DMD_MOST_JOINTS={JOINTS}", "-o", tmp_path / "size", size], check=True)
    player_bytes = int(subprocess.run([tmp_path / "size"], check=True, capture_output=True).stdout)
    assert abs(cost["ram"] - 784 - player_bytes) < 100  # pointers are longer here
    assert cost["flash"] > len(one.words)
    with pytest.raises(MotiondeckError, match=r"at worst it takes .* MHz of 1, .* kB of RAM of 2;"):
        cost_on(one, "M0+:1:2:256")
    with pytest.raises(MotiondeckError, match="core"):
        cost_on(one, "Z80")


def test_what_does_not_fit_is_refused_with_the_remedy(tmp_path, monkeypatch):
    library, names = joint_library(JOINTS), [f"joint{k}" for k in range(JOINTS)]
    with pytest.raises(MotiondeckError, match="joint3, which is no joint there"):
        figure_of(library, names[:3], LIMITS, 0.0 * ONES, 100.0)
    with pytest.raises(MotiondeckError, match="of joint 0 are too tight for 32-bit numbers at 100 Hz"):
        figure_of(library, names, replace(LIMITS, jerk=0.1 * ONES), 0.0 * ONES, 100.0)
    with pytest.raises(MotiondeckError, match=r"joint 0 turns by 20\.0 rad; fixed-point numbers hold 12"):
        figure_of(library, names, replace(LIMITS, upper=20.0 * ONES), 0.0 * ONES, 100.0, fixed=True)
    with pytest.raises(MotiondeckError, match="4 joints and 5 motions at 500 Hz; at most 64"):
        figure_of(library, names, LIMITS, 0.0 * ONES, 500.0)
    rough, many = joint_library(40), np.ones(40)
    rough.network._of["loop0"] += (
        np.random.default_rng(0).normal(size=(1, 40)) * (np.arange(len(rough.network["loop0"])) % 2)[:, None]
    )
    limits = JointLimits(-9.0 * many, 9.0 * many, many, many, many)
    with pytest.raises(MotiondeckError, match="loop0 is too long: in 8192 bytes"):
        figure_of(rough, [f"joint{k}" for k in range(40)], limits, 0.0 * many, 100.0)
    monkeypatch.setattr(figure_module, "MOST_MOTIONS", 4)
    with pytest.raises(MotiondeckError, match="5 motions at 100 Hz; at most 64, 4"):
        figure_of(library, names, LIMITS, 0.0 * ONES, 100.0)
    human = motiondeck("export", "thesis15", "--rig", "servo20", "--out", tmp_path).stderr
    assert "motions are those of a human; give the file of one baked" in human
    assert "name the robot with --robot, or the rig" in motiondeck("export", "thesis15", "--out", tmp_path).stderr
