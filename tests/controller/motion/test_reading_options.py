"""What a person says about a recording overrules its file, in every format that it can mean something to."""

from dataclasses import replace

import numpy as np
import pytest

from controller.motion.clip import ReadingOptions
from controller.motion.formats.markers.c3d import read_c3d
from controller.motion.formats.reading import read_clip
from motiondeck_base.errors import FileFormatError
from recordings import AMC, ASF, c3d_bytes, mat_bytes, pattern_fields


@pytest.fixture
def bow(tmp_path):
    (tmp_path / "mannequin.asf").write_text(ASF)
    (tmp_path / "bow.amc").write_text(AMC)
    return tmp_path / "bow.amc"


def test_an_acclaim_recording_takes_unit_axis_and_names(bow):
    plain = read_clip(bow)
    metres = read_clip(bow, ReadingOptions(unit=0.1))
    assert np.allclose(metres.joints(), plain.joints() * 0.1 * 0.45 / 0.0254)
    lying = read_clip(bow, ReadingOptions(up="z"))
    assert np.allclose(lying.joints(), plain.joints()[..., [1, 2, 0]])  # with y up we have its (z, x, y)
    named = read_clip(bow, ReadingOptions(rename={"leg": "LeftUpLeg"}))
    assert named.skeleton.bones == tuple(bone.replace("leg", "LeftUpLeg") for bone in plain.skeleton.bones)


@pytest.mark.parametrize(
    ("rename", "said"),
    [
        ({"lug": "LeftUpLeg"}, r"bow\.amc: nothing to rename is called 'lug' \(there are: hip, "),
        ({"leg": "foot"}, "'foot' would be the name of two"),
    ],
)
def test_names_that_cannot_be_exchanged_are_refused(bow, rename, said):
    with pytest.raises(FileFormatError, match=said):
        read_clip(bow, ReadingOptions(rename=rename))


def test_markers_take_unit_axis_and_names(tmp_path):
    seen = np.random.default_rng(1).normal(0.0, 900.0, (4, 2, 3))
    (tmp_path / "two.c3d").write_bytes(c3d_bytes(["a", "b"], seen))
    plain = read_c3d(tmp_path / "two.c3d")
    other = read_c3d(tmp_path / "two.c3d", ReadingOptions(unit=0.01, up="y", rename={"a": "LKNE"}))
    assert np.allclose(other.position, 10.0 * plain.position)
    assert (other.labels, other.up) == (("LKNE", "b"), "y")


@pytest.mark.parametrize("unit", [0.0, -0.01, 1e9, float("nan")])
def test_a_unit_that_is_no_length_is_refused(unit):
    with pytest.raises(FileFormatError, match="give the length of one unit of the file in m"):
        replace(ReadingOptions(), unit=unit)


def test_a_pattern_has_no_options(tmp_path):
    (tmp_path / "nnRawBow.mat").write_bytes(mat_bytes(pattern_fields()))
    with pytest.raises(FileFormatError, match=r"nnRawBow\.mat: a \.mat has fixed unit, axes and names"):
        read_clip(tmp_path / "nnRawBow.mat", ReadingOptions(unit=0.01))
