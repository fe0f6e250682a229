"""Motions computed from the conceptors of others: the laws of the algebra, and what is made of it moves."""

import dataclasses

import msgspec
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import synthetic
from controller.learning import motion_algebra
from controller.learning.motion_algebra import compute_motion, mixed_conceptor, similarities
from controller.learning.trainers.shared_conceptor import SharedConceptorRecipe
from controller.library.motion_library import MotionLibrary, load_library, save_library
from controller.motion.encodings.motion_matching import joint_features
from controller.networks.reservoirs.conceptor_algebra import adapt_aperture, similarity
from motiondeck.cli.main import main
from motiondeck_base.errors import MotiondeckError

LEAVES = st.sampled_from(["march", "wave", "(0.3 march + 0.7 wave)", "(1.2 wave - 0.2 march)"])
TERMS = st.recursive(
    LEAVES, lambda one: st.tuples(one, st.sampled_from("&|"), one).map("({0[0]} {0[1]} {0[2]})".format), max_leaves=3
)


def trained(known):
    recipe = SharedConceptorRecipe(**(synthetic.SMALL_SHARED | {"neurons": 200, "rank": 24, "readout": "shared"}))
    lessons = known.lessons()
    return synthetic.trained(recipe, lessons.motions, lessons.normalisation)


def stride(period=110):
    """Shorter steps than `march`, with the arms to the sides."""
    t = 2.0 * np.pi * np.arange(period) / period + 1.0
    legs = synthetic.swing(0.4 * np.sin(t), 0), synthetic.swing(-0.4 * np.sin(t), 0)
    arms = synthetic.swing(0.3 * np.sin(t) - 0.5, 1), synthetic.swing(0.3 * np.cos(t) + 0.5, 1)
    return synthetic.frames_of(0.85 + 0.03 * np.cos(2 * t), 0.6 + 0.1 * np.cos(2 * t), 0.1 * np.sin(t), legs, arms)


@pytest.fixture(scope="module")
def network():
    known = synthetic.training_set()
    frames, loops = known.frames | {"stride": stride()}, known.loops | {"stride": True}
    return trained(dataclasses.replace(known, frames=frames, loops=loops, least_range=1.0))


def library_of(network):
    whole = synthetic.small_library()
    infos = [
        msgspec.structs.replace(whole.info.motions[name == "bow" and 2], name=name, frames=len(network[name]))
        for name in network.motions
    ]
    fields = {"network": network.kind, "scales": network.scales, "motions": infos}
    return MotionLibrary(msgspec.structs.replace(whole.info, **fields), network, whole.encoding)


@pytest.fixture(scope="module")
def half(network):
    return compute_motion(library_of(network), "0.5 march + 0.5 stride", "half")


def conceptor_of(network, expression):
    found = mixed_conceptor(network, expression)
    return found.directions @ found.matrix @ found.directions.T, found.shares


def same(network, one, other, tolerance=1e-5):
    first, second = (conceptor_of(network, text) for text in (one, other))
    assert np.abs(first[0] - second[0]).max() < tolerance
    assert first[1] == pytest.approx(second[1])


@settings(max_examples=6, deadline=None)
@given(TERMS, TERMS, TERMS)
def test_and_and_or_obey_their_laws(network, a, b, c):
    same(network, f"{a} & {b}", f"{b} & {a}")
    same(network, f"{a} | {b}", f"{b} | {a}")
    same(network, f"{a} & ({b} & {c})", f"({a} & {b}) & {c}")
    same(network, f"{a} | ({b} | {c})", f"({a} | {b}) | {c}")
    same(network, f"~~{a}", a)
    same(network, f"~(~{a} | ~{b})", f"{a} & {b}")
    same(network, f"{c} & ~({a} | {b})", f"{c} & (~{a} & ~{b})")
    same(network, f"{a} | {b} & {c}", f"{a} | ({b} & {c})")
    values = np.linalg.eigvalsh(mixed_conceptor(network, f"{a} & ~{b} | {c}").matrix)
    assert -1e-9 < values.min() <= values.max() < 1.0 + 1e-9


@settings(max_examples=6, deadline=None)
@given(TERMS, TERMS, st.floats(0.0, 1.0))
def test_shares_mix_conceptors_and_mean_states(network, a, b, share):
    assume(1e-4 < share < 1.0 - 1e-4)
    # Each in the directions of both.
    (one, own), (other, its) = (conceptor_of(network, f"{by} {a} + {1 - by} {b}") for by in (1, 0))
    mixed, shares = conceptor_of(network, f"{1.0 - share:.9f} {a} + {share:.9f} {b}")
    assert np.abs(mixed - (1.0 - share) * one - share * other).max() < 1e-5
    wanted = {name: (1.0 - share) * own[name] + share * its[name] for name in own}
    assert shares == pytest.approx(wanted, abs=1e-6)
    same(network, f"0.5 {a} + 0.5 {a}", a)


def test_what_is_joined_with_itself_has_another_aperture(network):
    """C AND C = phi(C, 2^-1/2), C OR C = phi(C, 2^1/2) (Jaeger 2014, section 3.9)."""
    own = mixed_conceptor(network, "wave").matrix
    for sign, factor in (("&", np.sqrt(0.5)), ("|", np.sqrt(2.0))):
        twice = mixed_conceptor(network, f"wave {sign} wave").matrix
        np.testing.assert_allclose(twice, adapt_aperture(own, factor), atol=1e-6)


def test_what_is_taken_away_is_less_similar(network):
    found = {text: conceptor_of(network, text)[0] for text in ("march", "wave", "march & ~wave")}
    before, after = (similarity(found[one], found["wave"]) for one in ("march", "march & ~wave"))
    assert after < 0.5 * before


def test_similarity_is_that_of_dense_conceptors(network):
    def dense(name):
        stored = network[name].stored
        return (stored.basis[0] * stored.strength[0]) @ stored.basis[0].T

    found = similarities(network, "march")
    assert set(found) == {"wave", "bow", "stride"}
    for name, value in found.items():
        assert value == pytest.approx(similarity(dense("march"), dense(name)), rel=1e-3)
        assert similarities(network, name)["march"] == pytest.approx(value, rel=1e-6)


def test_a_morph_moves_between_both(half):
    network, encoding = half.library.network, half.library.encoding
    assert half.library.info.motions[-1].passed
    assert 0.5 < half.activity < 1.2
    assert half.jerk < 1.5
    middle = {name: joint_features(encoding, network[name].read()).mean(0) for name in ("march", "stride", "half")}
    off = np.abs(middle["half"] - 0.5 * (middle["march"] + middle["stride"])).max()
    assert off < 0.2 * np.abs(middle["march"] - middle["stride"]).max()
    assert len(network["half"]) == round(np.sqrt(96 * 110))


def test_one_motion_alone_plays_as_it_is(network):
    found = compute_motion(library_of(network), "1 march + 0 wave", "same")
    played, own = (found.library.network[name] for name in ("same", "march"))
    # The computed one begins where the reservoir's phase is 0.
    turn = round(own.course.turn / (2.0 * np.pi) * len(own))
    off = np.abs(played.read() - np.roll(own.read(), turn, axis=0)).max()
    assert off < 0.05
    assert found.activity == pytest.approx(1.0, abs=0.03)


def test_it_is_a_motion_without_a_readout_and_plays_the_same_from_a_file(half, network, tmp_path):
    arrays, before = half.library.network.arrays(), network.arrays()
    assert {name.rpartition("/")[2] for name in set(arrays) - set(before)} == {"directions", "strength", "mean", "held"}
    assert all(np.array_equal(arrays[name], before[name]) for name in before)
    save_library(half.library, tmp_path / "one.safetensors")
    loaded = load_library(tmp_path / "one.safetensors")
    assert len({part.course.turn for part in loaded.network.mixable.values()}) > 1
    for motion in loaded.network.motions:  # with their turns
        runs = []
        for one in (half.library.network.twin(), loaded.network):
            one.cue(motion, 3)
            runs.append(synthetic.run(one, 150))
        assert np.array_equal(*runs)
    assert loaded.info.motions[-1].source == "0.5 march + 0.5 stride"


def opposite(sign):
    """A loop whose right arm points to one side and swings a little."""
    t = 2.0 * np.pi * np.arange(90) / 90
    legs = synthetic.swing(0.3 * np.sin(t), 1), synthetic.swing(-0.3 * np.sin(t), 1)
    arms = synthetic.swing(0.1 * np.sin(t), 1), synthetic.swing(sign * (np.pi / 2 + 0.1 * np.sin(t)), 0)
    return synthetic.frames_of(0.9 + 0 * t, 0 * t + 0.3, 0 * t, legs, arms)


def test_a_bone_that_points_opposite_ways_does_not_turn_over(monkeypatch):
    frames = {"march": opposite(1), "wave": opposite(-1)}
    known = synthetic.TrainingSet(
        synthetic.small_encoding(), synthetic.RATE, frames, dict.fromkeys(frames, True), least_range=1.0
    )
    library = library_of(trained(known))
    assert compute_motion(library, "0.5 march + 0.5 wave", "half").jerk < 1.5
    monkeypatch.setattr(motion_algebra, "LEAN_ROUNDS", 0)
    assert compute_motion(library, "0.5 march + 0.5 wave", "half").jerk > 3.0


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        ("0.5 march + 0.6 wave", "add up to 1.1 and have to"),
        ("march & wafe", "unknown motion 'wafe'. Did you mean wave"),
        ("march & bow", "'bow' is a one-shot"),
        ("~march", "every motion in it is negated"),
        ("march | ~wave", "none of its motions does"),
        ("0.5 march + 0.5 ~wave", "what is negated has no share"),
        ("march & (wave", r"a \) is missing"),
        ("march wave", "'wave' is not expected there"),
        ("march &", "a motion is missing at its end"),
        ("& march", "a motion is missing before '&'"),
        ("", "a motion is missing at its end"),
        ("90 march - 89 wave", "a round would take"),
    ],
)
def test_what_cannot_be_read_or_played_is_refused_in_one_line(network, expression, message):
    with pytest.raises(MotiondeckError, match=message) as caught:
        compute_motion(library_of(network), expression, "new")
    assert "\n" not in str(caught.value)


def test_other_networks_and_taken_names_are_refused(network):
    for other in (synthetic.small_library(), library_of(synthetic.small_shared_conceptor())):
        with pytest.raises(MotiondeckError, match="share no readout"):
            compute_motion(other, "march & wave", "new")
    with pytest.raises(MotiondeckError, match="a motion 'wave' in the library"):
        compute_motion(library_of(network), "march", "wave")


def test_the_command_writes_what_moves_and_refuses_what_stands_still(network, tmp_path, capsys, monkeypatch):
    path = tmp_path / "mine.safetensors"
    save_library(library_of(network), path)

    def run(*words):
        monkeypatch.setattr("sys.argv", ["motiondeck", "library", "morph", str(path), *words])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code or 0, capsys.readouterr()

    code, shown = run("march & stride", "--name", "both", "--json")
    told = msgspec.json.decode(shown.out)
    assert (code, set(told["similarity"])) == (0, {"march", "wave", "bow", "stride"})
    assert load_library(path).network.motions == ("march", "wave", "bow", "stride", "both")
    # With two loops alone, neither of which moves what the other does, little is between them.
    save_library(library_of(trained(dataclasses.replace(synthetic.training_set(), least_range=1.0))), path)
    code, shown = run("march & wave", "--name", "none")
    assert code == 1
    assert "'none' failed (moves 0." in shown.err
    assert "none" not in load_library(path).network.motions
    assert run("march & wave", "--name", "none", "--allow-failing")[0] == 0
    assert not load_library(path).info.motions[-1].passed
