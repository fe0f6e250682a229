"""Recognition of real recordings: HDM05 across people, and one long trial of CMU's subject 86."""

import pytest

from benchmarks.recognition.committee import A_JOINT, GROUPS
from benchmarks.recognition.contenders import contenders, doubters, ours
from benchmarks.recognition.first_occurrences import LOOK
from benchmarks.recognition.folds import measure
from benchmarks.recognition.recorded_angles import recorded_angles
from benchmarks.recognition.segment_labels import read_labels
from benchmarks.recognition.segmentation import experts
from benchmarks.recognition.unknown import unknown_auc
from controller.learning.recognition.features import features
from controller.learning.recognition.labelled_recordings import read_dataset
from controller.motion.formats.reading import read_clip

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def hdm05(mocap_data):
    folder = mocap_data / "hdm05"
    if not folder.is_dir():
        pytest.skip("the folder of recordings has no hdm05")
    return read_dataset(folder)


def test_people_never_seen_are_recognized(hdm05):
    assert measure("ours", ours, hdm05, "actor-out", [1]).accuracy >= 0.99
    assert measure("ours", ours, hdm05, "one-actor", [1]).accuracy >= 0.96


def test_the_proposal_to_the_letter_is_not_good_enough(hdm05):
    proposed, _ = contenders()["proposal, 50 neurons"]
    assert measure("proposal", proposed, hdm05, "actor-out", [1]).accuracy < 0.5


@pytest.mark.parametrize("protocol", ["actor-out", "one-actor"])
def test_a_committee_tells_unknown_motions(hdm05, protocol):
    in_committee = doubters(hdm05, 1, [(GROUPS, A_JOINT)])[-1]
    assert unknown_auc(in_committee, hdm05.labels, hdm05.actors, protocol) >= 0.97


def test_the_proposals_channels_are_the_59_angles(hdm05):
    example = hdm05.examples[0]
    assert recorded_angles(example.path).shape == (len(example.clip), 59)


def test_subject_86_is_cut_where_it_was_marked(mocap_data):
    folder = mocap_data / "cmu" / "86"
    if not (folder / "86_01.amc").is_file():
        pytest.skip("the folder of recordings has no cmu/86/86_01.amc")
    signal = features(read_clip(folder / "86_01.amc"), LOOK)
    _, right, f1 = experts(signal, read_labels(folder / "labels" / "barbic_01_ground_truth.txt"), 1)
    assert f1 == 1.0
    assert right >= 0.985
