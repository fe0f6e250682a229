"""Several people in a file are named, each is read on demand, and each is a take of its own to learn."""

import numpy as np
import pytest

from controller.learning.learn import learn
from controller.motion.formats.reading import read_clip
from controller.motion.people import SeveralPeopleError
from controller.motion.reading_options import ReadingOptions
from motiondeck_base.errors import FileFormatError
from written_files import trc_text

JOINTS = {  # m: x forward, y left, z up
    "LHip": (0.0, 0.1, 0.9), "RHip": (0.0, -0.1, 0.9), "LKnee": (0.02, 0.1, 0.5), "RKnee": (0.02, -0.1, 0.5),
    "LAnkle": (0.0, 0.1, 0.09), "RAnkle": (0.0, -0.1, 0.09), "Neck": (0.0, 0.0, 1.45), "LShoulder": (0.0, 0.18, 1.4),
    "RShoulder": (0.0, -0.18, 1.4), "LElbow": (0.0, 0.2, 1.1), "RElbow": (0.0, -0.2, 1.1), "LWrist": (0.05, 0.2, 0.85),
    "RWrist": (0.05, -0.2, 0.85),
}  # fmt: skip
TIME = np.arange(180) / 60.0


def person(size, pace):
    """The joints of a body of some size that walks along and swings an arm, (T, 13, 3), m."""
    tracks = np.tile(size * np.array([*JOINTS.values()]), (len(TIME), 1, 1))
    tracks[:, :, 0] += 0.5 * TIME[:, None]
    tracks[:, [*JOINTS].index("LWrist"), 0] += 0.2 * np.sin(pace * TIME)
    return tracks


def written(tmp_path, between=":"):
    labels = [f"{name}{between}{joint}" for name in ("Anna", "Ben") for joint in JOINTS]
    path = tmp_path / "duo.trc"
    path.write_text(trc_text(labels, np.concatenate([person(1.0, 3.0), person(0.8, 5.0)], axis=1), 60.0))
    return path


@pytest.mark.parametrize("between", [":", "_"])
def test_none_of_several_people_is_taken_in_silence(tmp_path, between):
    path = written(tmp_path, between)
    with pytest.raises(SeveralPeopleError, match=r"holds 2 people \(Anna, Ben\)\. Choose one: --skeleton NAME"):
        read_clip(path)
    with pytest.raises(FileFormatError, match="no person in it is called 'Eve'"):
        read_clip(path, ReadingOptions(person="Eve"))
    heights = [read_clip(path, ReadingOptions(person=name)).joints()[..., 2].max() for name in ("Anna", "Ben")]
    assert heights[1] == pytest.approx(0.8 * heights[0], rel=0.05)


def test_one_person_with_a_name_is_read_as_before(tmp_path):
    path = tmp_path / "solo.trc"
    path.write_text(trc_text([f"Anna:{joint}" for joint in JOINTS], person(1.0, 3.0), 60.0))
    assert len(read_clip(path)) == len(TIME)


def test_each_person_is_learned_under_a_name(tmp_path):
    learned = learn([written(tmp_path)], "duo", seeds=[0])
    assert [motion.name for motion in learned.motions] == ["duo-Anna", "duo-Ben"]
    assert [motion.person for motion in learned.recipe.motions] == ["Anna", "Ben"]
