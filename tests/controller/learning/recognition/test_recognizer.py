import contextlib
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from safetensors import safe_open
from safetensors.numpy import save_file

from controller.learning.recognition.experts import STRETCHED_LEAK, ExpertRecipe, teach
from controller.learning.recognition.features import FeatureRecipe
from controller.learning.recognition.recognizer import KEY, load_recognizer, save_recognizer, train_recognizer
from motiondeck_base.errors import FileFormatError, MotiondeckError
from recognition_examples import clip, dataset


@pytest.fixture(scope="module")
def trained():
    return train_recognizer(dataset(("ann", "bob")), FeatureRecipe(), ExpertRecipe(neurons=50))


@pytest.fixture(scope="module")
def shown_by_ann():
    experts = ExpertRecipe(neurons=64, groups=4, leak=STRETCHED_LEAK)
    return train_recognizer(dataset(("ann",)), FeatureRecipe(), experts, (0.5, 1.0, 2.0))


@pytest.fixture(scope="module")
def file(trained, tmp_path_factory):
    path = tmp_path_factory.mktemp("recognizer") / "three.safetensors"
    save_recognizer(trained, path, licence="none needed")
    return path


@pytest.mark.parametrize("motion", ["bow", "march", "wave"])
@pytest.mark.parametrize("pace", [0.75, 1.0, 1.3])
def test_somebody_new_is_recognized_at_another_pace(trained, motion, pace):
    verdict = trained.recognize(clip(motion, "cem", pace, 5))
    assert (verdict.motion, verdict.known) == (motion, True)
    assert min(verdict.costs, key=verdict.costs.get) == motion


@pytest.mark.parametrize("pace", [0.5, 1.3, 2.0])
def test_what_one_person_has_shown_is_known_in_others_at_any_tempo(shown_by_ann, pace):
    for motion in ("bow", "march", "wave"):
        for who in ("bob", "cem"):
            verdict = shown_by_ann.recognize(clip(motion, who, pace, 5))
            assert (verdict.motion, verdict.known) == (motion, True)


def test_the_threshold_of_one_persons_motions_rejects_what_that_person_has_not_shown(shown_by_ann):
    """Half of the clips of each motion left out in turn fall short of it: the price of knowing what others do."""
    bank = shown_by_ann.bank
    signals = {m: [shown_by_ann.features(clip(m, "ann", pace, 7)) for pace in (0.6, 1.0, 1.6)] for m in bank.classes}
    short = []
    for left_out in bank.classes:
        learned = [(s, m) for m in bank.classes if m != left_out for s in signals[m]]
        without = teach(bank.recipe, [s for s, _ in learned], [m for _, m in learned])
        short.extend(without.confidences(without.costs(without.force(signals[left_out]))) < shown_by_ann.threshold)
    assert np.mean(short) > 0.3


def test_a_motion_that_was_never_learned_has_a_smaller_margin(trained):
    without = train_recognizer(dataset(("ann", "bob"), ("bow", "march")), FeatureRecipe(), ExpertRecipe(neurons=50))
    assert without.recognize(clip("wave", "cem")).margin < trained.recognize(clip("wave", "cem")).margin


def test_below_the_threshold_a_motion_is_unknown(trained):
    errors, costs = np.array([0.0, trained.threshold * 0.5, 5.0]), np.array([1.0, 0.0, 5.0])
    assert not trained.verdict(errors, costs).known
    above = trained.verdict(np.array([0.0, trained.threshold * 2.0 + 1e-9, 5.0]), costs)
    assert (above.motion, above.known, above.margin) == (trained.bank.classes[1], True, 1.0)


def test_a_clip_of_one_frame_is_refused(trained):
    with pytest.raises(MotiondeckError, match="too short to be recognized"):
        trained.recognize(clip("march", "cem", 0.01))


def test_one_class_is_not_enough():
    with pytest.raises(MotiondeckError, match="only one class, 'bow'"):
        train_recognizer(dataset(motions=("bow",)), FeatureRecipe(), ExpertRecipe())


def same(one, other):
    ours, theirs = (recognizer.recognize(clip("march", "cem")) for recognizer in (one, other))
    assert (ours.motion, ours.known) == (theirs.motion, theirs.known)
    assert ours.costs == pytest.approx(theirs.costs, abs=1e-9)


def test_a_file_brings_back_the_same_recognizer(trained, file):
    again = load_recognizer(file)
    same(again, trained)
    assert again.recipe == trained.recipe
    assert again.sources == trained.sources


def test_a_committee_comes_back_from_its_file(tmp_path):
    experts = ExpertRecipe(neurons=48, groups=4)
    trained = train_recognizer(dataset(("ann", "bob")), FeatureRecipe(), experts)
    save_recognizer(trained, tmp_path / "committee.safetensors")
    again = load_recognizer(tmp_path / "committee.safetensors")
    assert again.bank.recipe == experts
    same(again, trained)


NO_MODELS = {"model_weights": None, "model_offset": None}


@pytest.mark.parametrize("version", [1, 2])
def test_a_file_of_an_older_version_says_what_its_experts_say(trained, file, tmp_path, version):
    sums = {"yy": np.array([of.yy.sum() for of in trained.bank.moments])} if version == 1 else {}
    old = load_recognizer(rewritten(file, tmp_path / "old.safetensors", sums | NO_MODELS, {"version": version}))
    asked = clip("march", "cem")
    expected = trained.bank.costs(trained.bank.force([trained.features(asked)]))[0]
    assert list(old.recognize(asked).costs.values()) == pytest.approx(expected.tolist(), abs=1e-9)


def rewritten(file, out, arrays=None, header=None):
    with safe_open(file, framework="numpy") as opened:
        there = {name: opened.get_tensor(name) for name in opened.keys()}  # noqa: SIM118
        metadata = opened.metadata()
    info = json.loads(metadata[KEY]) | (header or {})
    there |= arrays or {}
    save_file({name: a for name, a in there.items() if a is not None}, out, metadata={KEY: json.dumps(info)})
    return out


@pytest.mark.parametrize(("arrays", "header", "said"), [
    ({"xx": None}, {}, "array 'xx' is missing"),
    ({"bias": np.zeros(3)}, {}, "array 'bias' is float64 of shape"),
    ({"bias": np.zeros(50, dtype=np.float32)}, {}, "is float32"),
    ({"weights": np.full((50, 50), np.nan)}, {}, "not finite"),
    ({"more": np.zeros(3)}, {}, "array 'more', which nothing needs"),
    ({"model_weights": None}, {}, "array 'model_weights' is missing"),
    ({"model_weights": np.zeros((3, 5), dtype=np.float32)}, {}, "array 'model_weights' is float32 of shape"),
    ({"count": np.zeros(3)}, {}, "trained on nothing"),
    ({"xx": -np.ones((3, 50, 50))}, {}, "moments"),
    ({"input_weights": np.zeros(3)}, {}, "'input_weights' is missing or empty"),
    ({}, {"version": 9}, "format version 9"),
    ({}, {"classes": ["a", "a", "b"]}, "one twice"),
    ({}, {"threshold": -1e4}, "threshold"),
    ({}, {"colour": "red"}, "unknown key 'colour'"),
    ({}, {"experts": {"neurons": 0}}, "at least one neuron"),
])  # fmt: skip
def test_a_wrong_file_is_refused_by_name_and_reason(file, tmp_path, arrays, header, said):
    path = rewritten(file, tmp_path / "wrong.safetensors", arrays, header)
    with pytest.raises(FileFormatError, match=said) as caught:
        load_recognizer(path)
    assert "wrong.safetensors" in str(caught.value)


def test_other_files_are_refused(tmp_path):
    with pytest.raises(FileFormatError, match="no such file"):
        load_recognizer(tmp_path / "none")
    save_file({"a": np.zeros(2)}, tmp_path / "other", metadata={"motiondeck": "{}"})
    with pytest.raises(FileFormatError, match="not a recognizer"):
        load_recognizer(tmp_path / "other")


@given(cut=st.integers(0, 5000), byte=st.integers(0, 255))
def test_a_damaged_file_never_does_anything_but_complain(file, tmp_path, cut, byte):
    content = bytearray(file.read_bytes())
    broken = tmp_path / "broken"
    broken.write_bytes(content[:cut])
    with pytest.raises(FileFormatError):
        load_recognizer(broken)
    content[cut] = byte
    broken.write_bytes(content)
    with contextlib.suppress(FileFormatError):
        assert np.isfinite(load_recognizer(broken).bank.readouts).all()


def test_a_folder_that_is_not_there_cannot_be_written_to(trained, tmp_path):
    with pytest.raises(FileFormatError, match="cannot be written"):
        save_recognizer(trained, tmp_path / "none" / "x.safetensors")


def test_learned_at_several_stretches_a_motion_is_known_at_each_of_them():
    experts = ExpertRecipe(neurons=50, leak=1.0)
    once = train_recognizer(dataset(("ann", "bob")), FeatureRecipe(), experts)
    trained = train_recognizer(dataset(("ann", "bob")), FeatureRecipe(), experts, (0.5, 1.0, 2.0))
    assert trained.clips == once.clips
    assert trained.sources == once.sources
    assert sum(of.count for of in trained.bank.moments) > 3.0 * sum(of.count for of in once.bank.moments)
    for pace in (0.5, 2.0):
        asked = clip("march", "cem", pace, 5)
        assert trained.recognize(asked).motion == "march"
        assert trained.recognize(asked).costs["march"] < once.recognize(asked).costs["march"]


@pytest.mark.parametrize("stretch", [0.0, -1.0, 11.0, float("nan")])
def test_an_impossible_stretch_is_refused(stretch):
    with pytest.raises(MotiondeckError, match=r"a stretch of .*: give 0\.1 to 10"):
        train_recognizer(dataset(("ann", "bob")), FeatureRecipe(), ExpertRecipe(neurons=10), (1.0, stretch))
