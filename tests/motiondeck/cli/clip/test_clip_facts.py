"""The facts of a recording are those of its joints and its markers."""

import json

import numpy as np
import pytest

from controller.motion.clip import Clip
from controller.motion.formats.markers.marker_fit import Fit
from controller.motion.formats.reading import FittedClip, read_fitted
from motiondeck.cli.clip.clip_facts import facts, gaps
from recordings import BVH
from simulated_bodies import human


def test_a_body_that_slides_along():
    body = human()
    position = np.stack([np.linspace(0.0, 1.0, 11), np.zeros(11), np.full(11, 0.88)], axis=-1)
    clip = Clip("slide", body, 10.0, position, np.tile([1.0, 0.0, 0.0, 0.0], (11, 20, 1)), "slide.bvh")
    known = facts(FittedClip(clip, None))
    assert (known["frames"], known["bones"], known["rate"]) == (11, 19, 10.0)
    assert known["duration"] == pytest.approx(1.1)
    assert known["path"] == pytest.approx(1.0)
    assert known["median_speed"] == pytest.approx(1.0)
    assert known["fastest_speed"] == pytest.approx(1.0)
    np.testing.assert_allclose(known["z"], [0.0, 0.88 + 0.64], atol=1e-12)
    np.testing.assert_allclose(known["x"], [0.0, 1.16], atol=1e-12)
    assert known["lacks"] == []
    assert known["gaps"] is None
    json.dumps(known)


def test_one_frame_does_not_move(tmp_path):
    (tmp_path / "still.bvh").write_text("\n".join(BVH.replace("Frames: 2", "Frames: 1").splitlines()[:-1]))
    known = facts(read_fitted(tmp_path / "still.bvh"))
    assert known["fastest_speed"] == known["path"] == 0.0
    assert known["frames"] == 1


def test_gaps_are_counted_by_marker():
    residual = np.full((10, 2), 0.003)
    residual[2:5, 1] = residual[8, 1] = residual[0, 0] = np.nan
    residual[9, 0] = 0.05
    fit = Fit(clip=None, markers=("C7", "LKNE"), residual=residual)  # pyright: ignore[reportArgumentType]
    known = gaps(fit)
    assert known["seen"] == pytest.approx(0.75)
    assert (known["longest_gap"], known["longest_gap_marker"]) == (3, "LKNE")
    assert known["residual_max_mm"] == pytest.approx(50.0)
    assert known["residual_p95_mm"] > 3.0


def test_decisions_of_reading_and_learning_are_among_the_facts(tmp_path):
    (tmp_path / "still.bvh").write_text(BVH)
    steps = [decision["step"] for decision in facts(read_fitted(tmp_path / "still.bvh"))["decisions"]]
    assert steps[:2] == ["unit", "up axis"]  # it is too short to be learned
