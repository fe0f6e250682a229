"""The process that learns for the page: what it reads, and only once."""

import shutil

import numpy as np
import pytest

from controller.learning import recording_analysis
from controller.motion.formats.reading import read_clip
from motiondeck.page.learning.learning_process import LearnRequest
from motiondeck.run.page import learning as page_learning


@pytest.mark.thorough
def test_a_body_is_fitted_to_markers_once_and_it_is_said_that_it_takes_a_while(tmp_path, mocap_data, monkeypatch):
    said, read, look_at = [], [], recording_analysis.analyse_recording
    monkeypatch.setattr(page_learning, "send", said.append)
    monkeypatch.setattr(
        recording_analysis, "analyse_recording", lambda *given, **how: read.append(*look_at(*given, **how)) or read[-1:]
    )
    file = tmp_path / "jog.c3d"
    shutil.copy(mocap_data / "c3d" / "02_03_runjog.c3d", file)
    seen = page_learning.inspect(LearnRequest(str(file)))
    assert "fitted to its markers" in said[0].text
    assert seen.file == str(tmp_path / "jog.bvh")
    assert np.abs(read[0].clip.joints() - read_clip(seen.file).joints()).max() < 1e-6
    file.unlink()
    twice = page_learning.inspect(LearnRequest(seen.file))
    assert (twice.seconds, twice.moving) == (pytest.approx(seen.seconds), pytest.approx(seen.moving))
