"""The judge of `benchmarks faithful` finds a library that is broken on purpose, and no fault in one that is not."""

from types import SimpleNamespace

import numpy as np
import pytest

import motiondeck
from benchmarks.recordings.faithful import faithful, grouped, judge, judged, with_seam
from benchmarks.recordings.faithful_files import PATTERN_BONES, Recorded, source_and_actor
from benchmarks.recordings.faithful_measure import Part, Played, measure

RATE = 120.0
SECONDS = 3.0
ONCE, LOOP = Part(0.0, SECONDS, "once"), Part(0.0, SECONDS, "loop")


def person(seconds):
    """Landmarks of a person who lifts the left leg and swings the arms, shape (T, 3) each, m."""
    beat = 2.0 * np.pi * seconds / SECONDS
    zero, one = np.zeros_like(beat), np.ones_like(beat)
    places = {"root": np.stack([zero, zero, 0.9 * one], axis=1)}
    for side, y in (("l", 1.0), ("r", -1.0)):
        lifts = 0.8 * np.maximum(np.sin(beat), 0.0) ** 2 * (side == "l")
        swings = np.sin(2.0 * beat + y)
        leg, arm = (np.stack([np.sin(angle), zero, -np.cos(angle)], axis=1) for angle in (lifts, swings))
        hip = places["root"] + np.array([0.0, 0.1 * y, 0.0])
        shoulder = places["root"] + np.array([0.0, 0.2 * y, 0.5])
        places |= {
            f"{side}hip": hip,
            f"{side}kne": hip + 0.4 * leg,
            f"{side}ank": hip + 0.8 * leg,
            f"{side}foo": hip + 0.8 * leg + np.array([0.12, 0.0, -0.05]),
            f"{side}sho": shoulder,
            f"{side}elb": shoulder + 0.3 * arm,
            f"{side}wri": shoulder + 0.55 * arm,
            f"{side}han": shoulder + 0.65 * arm,
        }
    places["neck"] = places["root"] + np.array([0.0, 0.0, 0.5])
    places["head"] = places["root"] + np.array([0.0, 0.0, 0.7])
    return places


@pytest.fixture
def file():
    return Recorded(person(np.arange(round(SECONDS * RATE)) / RATE), RATE)


def played(part, *, late=0.0):
    """The same person elsewhere on the floor, turned by a radian, a tenth larger."""
    seconds = np.arange(round(3.2 * SECONDS * RATE)) / RATE - late
    last = SECONDS - 1.0 / RATE
    places = person(np.clip(seconds, 0.0, last) if part.plays == "once" else seconds % SECONDS)
    turn = np.array([[np.cos(1.0), np.sin(1.0), 0.0], [-np.sin(1.0), np.cos(1.0), 0.0], [0.0, 0.0, 1.0]])
    return Played({bone: 1.1 * (track @ turn) + [2.0, -1.0, 0.0] for bone, track in places.items()}, RATE)


@pytest.mark.parametrize("part", [ONCE, LOOP])
def test_a_perfect_run_has_no_error(file, part):
    row = measure(file, played(part), part)
    assert row["mm_worst"] < 1e-6
    assert row["degrees_worst"] < 1e-5
    assert row["size"] == pytest.approx(1.1)
    assert row["floor_mm"] == pytest.approx(0.0, abs=1e-6)
    assert row["delay_ms"] == pytest.approx(0.0, abs=0.3)
    assert row["slide_played_mm"] == pytest.approx(row["slide_recorded_mm"])
    assert faithful(row)
    assert with_seam(row)


def test_longer_arms_are_the_body_and_not_the_motion(file):
    run = played(ONCE)
    for side in "lr":
        shoulder = run.places[f"{side}sho"]
        for end in ("elb", "wri", "han"):
            run.places[f"{side}{end}"] = shoulder + 1.2 * (run.places[f"{side}{end}"] - shoulder)
    row = measure(file, run, ONCE)
    assert row["mm_p95"] > 50.0
    assert row["degrees_worst"] < 1e-5
    assert row["own_body_mm"] < 1e-3


def test_a_recording_that_does_not_return_is_said_to_have_a_gap(file):
    assert measure(file, played(LOOP), LOOP)["gap_mm"] < 10.0
    rising = {
        bone: track + np.linspace(0.0, 0.1, len(track))[:, None] * [0.0, 0.0, 1.0]
        for bone, track in file.places.items()
    }
    assert measure(Recorded(rising, RATE), played(LOOP), LOOP)["gap_mm"] == pytest.approx(50.0, abs=10.0)


def test_an_arm_turned_by_five_degrees_is_found_with_its_name(file):
    run = played(ONCE)
    angle, pivot = np.radians(5.0), run.places["lsho"]  # about a level axis, not quite across the arm's swing
    turn = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])
    for bone in ("lelb", "lwri", "lhan"):
        run.places[bone] = pivot + (run.places[bone] - pivot) @ turn.T
    row = measure(file, run, ONCE)
    assert row["degrees_joint"] in ("lelb", "lwri", "lhan")
    assert row["degrees_worst"] == pytest.approx(5.0, abs=0.1)
    assert row["held_degrees"] > 3.0
    assert not faithful(row)


@pytest.mark.parametrize("frames", [1, -1])
def test_a_one_shot_that_starts_a_frame_late_or_early_is_found(file, frames):
    row = measure(file, played(ONCE, late=frames / RATE), ONCE)
    assert row["delay_ms"] == pytest.approx(1000.0 * frames / RATE, abs=0.6)
    assert row["held_degrees"] == pytest.approx(0.0, abs=0.1)


def test_feet_twenty_millimetres_too_low_are_found(file):
    run = played(ONCE)
    for track in run.places.values():
        track[:, 2] -= 0.022
    row = measure(file, run, ONCE)
    assert row["floor_mm"] == pytest.approx(-20.0, abs=0.1)
    assert row["mm_median"] == pytest.approx(20.0, abs=0.1)
    assert not faithful(row)


def test_a_loop_that_leaves_its_recording_at_the_seam_only_is_told_from_one_that_never_does(file):
    run = played(LOOP)
    phase = np.arange(len(run.places["lwri"])) / RATE % SECONDS
    for bone in ("lelb", "lwri", "lhan", "relb", "rwri", "rhan"):
        run.places[bone] += np.where(phase < 0.2, 0.05, 0.0)[:, None]
    row = measure(file, run, LOOP)
    assert faithful(row)
    assert not with_seam(row)


def test_a_file_whose_hips_are_at_zero_is_judged_by_where_soles_are(file):
    sunk = Recorded({bone: track - np.array([0.0, 0.0, 0.9]) for bone, track in file.places.items()}, RATE)
    on_the_floor, below = played(ONCE), played(ONCE)
    for track in below.places.values():
        track[:, 2] -= 1.1 * 0.9
    assert abs(measure(sunk, on_the_floor, ONCE)["floor_mm"]) < 10.0
    assert measure(sunk, below, ONCE)["floor_mm"] < -500.0


def test_an_end_may_slow_down_but_not_leave_what_was_recorded(file):
    slower, beyond = played(ONCE), played(ONCE)
    t = np.arange(len(slower.places["lwri"])) / RATE
    last = SECONDS - 1.0 / RATE
    begin, share = last - 0.2, np.clip((t - last + 0.2) / 0.4, 0.0, 1.0)  # the clock slows down to rest within 0.4 s
    clock = np.where(t < begin, t, begin + 0.2 * (1.0 - (1.0 - share) ** 2))
    slower.places.update(person(clock))
    beyond.places.update(person(np.minimum(t, last)))
    beyond.places["lwri"] = beyond.places["lwri"] + np.where(t > last, 0.08, 0.0)[:, None] * [1.0, 0.0, 0.0]
    row = measure(file, slower, ONCE)
    assert row["mm_worst"] < 5.0
    assert row["held_degrees"] < 0.1
    assert measure(file, beyond, ONCE)["held_degrees"] > 10.0


def test_the_rules_know_source_and_actor_of_each_recording(mocap_data):
    groups = grouped(mocap_data, None, None, 0, mixed=False)
    actors = {source: {actor for of, actor in groups if of == source} for source, _ in groups}
    assert actors["HDM05"] == {"bd", "bk", "dg", "mm", "tr"}
    assert "86" in actors["CMU"]
    assert actors["Bandai"] == {"bandai"}
    assert {len(grouped(mocap_data, "HDM05", 7, seed, mixed=True)["HDM05", "all"]) for seed in range(3)} == {7}
    assert source_and_actor(mocap_data / "c3d" / "0803_walk.c3d", mocap_data) == ("C3D", "08")
    assert source_and_actor(mocap_data / "cmu" / "86" / "86_10.npy", mocap_data) is None
    assert len(PATTERN_BONES) == 19


def test_a_learned_recording_is_judged_and_a_broken_library_is_not_faithful(mocap_data):
    path = mocap_data / "bvh/bandai/walk_normal_001.bvh"
    (row,) = judged(("Bandai", "bandai"), [path], mocap_data)
    assert row["mm_median"] < 10.0
    assert row["degrees_median"] < 1.0
    assert 0.95 < row["size"] < 1.05
    assert abs(row["floor_mm"]) < 10.0


def test_what_learn_left_out_and_what_the_judge_cannot_read_have_their_reasons(tmp_path):
    told = {"name": "a", "file": str(tmp_path / "a.fbx"), "plays": None, "remedy": "no such format"}
    library = SimpleNamespace(spec=motiondeck.Library)
    assert judge(library, told, {})["left_out"] == "no such format"
    told |= {"plays": "once", "from_s": 0.0, "to_s": 1.0}
    assert ".fbx" in judge(library, told, {})["not_judged"]
