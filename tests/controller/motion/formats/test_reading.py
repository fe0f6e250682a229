import numpy as np
import pytest

from controller.motion.clip import ReadingOptions
from controller.motion.formats.reading import read_clip
from motiondeck_base.errors import FileFormatError
from recordings import AMC, ASF, mat_bytes, pattern_fields


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "mannequin.asf").write_text(ASF)
    (tmp_path / "bow.amc").write_text(AMC)
    (tmp_path / "nnRawBow.mat").write_bytes(mat_bytes(pattern_fields()))
    return tmp_path


def test_the_reader_is_chosen_by_the_suffix(folder):
    assert read_clip(folder / "nnRawBow.mat").name == "Bow"
    assert read_clip(str(folder / "bow.amc")).name == "bow"


def test_capitals_in_the_suffix_do_not_matter(folder):
    (folder / "bow.amc").rename(folder / "BOW.AMC")
    (folder / "mannequin.asf").rename(folder / "MANNEQUIN.ASF")
    assert len(read_clip(folder / "BOW.AMC")) == 3


def test_the_skeleton_may_be_given(folder):
    (folder / "elsewhere").mkdir()
    (folder / "elsewhere" / "inches.asf").write_text(ASF.replace("length 0.45", "length 1.0"))
    ours, given = (
        read_clip(folder / "bow.amc"),
        read_clip(folder / "bow.amc", ReadingOptions(folder / "elsewhere" / "inches.asf")),
    )
    assert given.skeleton.name == "inches"
    assert np.allclose(given.joints() / 0.45, ours.joints())


def test_two_skeletons_beside_a_recording_are_one_too_many(folder):
    (folder / "other.asf").write_text(ASF)
    with pytest.raises(FileFormatError, match=r"bow\.amc: there are 2 \.asf files \(mannequin\.asf, other\.asf\)"):
        read_clip(folder / "bow.amc")


def test_a_recording_without_a_skeleton_is_refused(folder):
    (folder / "mannequin.asf").unlink()
    with pytest.raises(FileFormatError, match=r"no \.asf files beside it\. Give the recording's own .*--skeleton"):
        read_clip(folder / "bow.amc")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("gone.amc", "no such file"),
        ("gone.mat", "No such file"),
        (
            "walk.fbx",
            r"walk\.fbx: a closed format that is not read\. Convert it with FBX2glTF \(to \.glb\), or in Blender",
        ),
        ("walk", "a recording is known by its ending, and this has none"),
        ("walks.zip", "packed. Unpack it"),
        ("walk.vmd", r"MikuMikuDance.*Import it in Blender"),
        ("walk.tak", r"Motive.*Export it there as \.c3d, \.bvh or \.trc"),
        ("walk.usda", "not read. Convert it in Blender"),
        ("mannequin.asf", "a skeleton, not a motion"),
        ("zero\0byte.amc", "no such file"),
    ],
)
def test_what_cannot_be_read_is_said(folder, name, said):
    with pytest.raises(FileFormatError, match=said):
        read_clip(folder / name)
