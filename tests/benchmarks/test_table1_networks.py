"""The paper's table: both methods tell markers, learned satellites better, and only its own recording is taken."""

import numpy as np
import pytest

import synthetic
from benchmarks.papers.table1_networks import (
    BORDERS,
    MARKERS,
    PAPER,
    centralized_table1,
    fixed_network,
    learned_network,
)
from controller.learning.centralized.model_choice import mean_absolute, relative_accuracy
from controller.motion.clip import walked_clip
from controller.motion.formats.reading import read_clip
from motiondeck_base.errors import FileFormatError


@pytest.mark.parametrize("centers", [1, 3])
def test_both_methods_tell_markers_made_of_waves(centers):
    t = np.arange(300) / 120.0
    rng = np.random.default_rng(0)
    waves = np.sin(np.multiply.outer(t, rng.uniform(2, 8, 12)) + rng.uniform(0, 6, 12))
    markers = 100.0 * waves.reshape(300, 4, 3) + 300.0
    learned = learned_network(markers, 120.0, centers, 16, iterations=60)
    assert mean_absolute(learned, markers) < 5.0
    fixed = fixed_network(markers, 120.0, centers, 16)
    assert fixed.shape == markers.shape
    assert mean_absolute(learned, markers) < mean_absolute(fixed, markers) < 70.0


def test_on_the_papers_second_segment_learned_satellites_are_better_than_the_paper(mocap_data):
    clip = read_clip(mocap_data / "cmu/86/86_01.amc")
    names = ("root", *clip.skeleton.bones)
    markers = 1e3 * clip.joints()[BORDERS[1] : BORDERS[2], [names.index(marker) for marker in MARKERS]]
    learned = relative_accuracy(learned_network(markers, clip.rate, 2, 25), markers).mean()
    fixed = relative_accuracy(fixed_network(markers, clip.rate, 2, 25), markers).mean()
    assert learned < 0.6 * PAPER[2, 25][1]
    assert fixed < 1.5 * PAPER[2, 25][1]


def test_another_recording_is_refused():
    encoding = synthetic.small_encoding()
    clip = walked_clip("march", encoding.skeleton, encoding.decode(synthetic.march()), 120.0)
    with pytest.raises(FileFormatError, match="'march' is not CMU 86 trial 1"):
        next(centralized_table1(clip))
