"""BVH as LAFAN1, SOMA and others write it, beyond names: axes of the joints, floors, ends, position channels."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import written_files
from controller.motion.canonical.body_doubts import doubts
from controller.motion.canonical.canonical_body import landmarks_of, to_canonical
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import dot, normalise
from people import KEYS, check_person, in_our_axes, moving
from written_files import LAFAN1, MIXAMO, SOMA, bvh_text

MOTION = moving(frames=60, reach=0.4)
ENDS = tuple(key for key in MIXAMO if key.endswith(" end"))
FILES = {
    "LAFAN1": (bvh_text(MOTION, LAFAN1, along_x=True), ENDS),
    "SOMA": (bvh_text(MOTION, SOMA, along_x=True, floor="Root", everywhere=True, offset_words=6), ()),
    "Mixamo": (bvh_text(MOTION, {key: f"mixamorig:{name}" for key, name in MIXAMO.items()}), ()),
    "a reference on the floor": (bvh_text(MOTION, floor="Reference"), ()),
    **{f"rotations {order}": (bvh_text(MOTION, order=order), ()) for order in ("XYZ", "YXZ", "ZXY", "YZX", "XZY")},
}


@pytest.mark.thorough
@pytest.mark.parametrize("along_x", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_a_person_is_told_by_shape_where_names_say_nothing(tmp_path, seed, along_x):
    """Limbs and their sides, whatever the arms do, in poses that nothing was chosen on."""
    motion = moving(frames=80, seed=seed, reach=0.9)
    (tmp_path / "walk.bvh").write_text(
        bvh_text(motion, {key: f"n{n}" for n, key in enumerate(MIXAMO)}, along_x=along_x)
    )
    clip = read_clip(tmp_path / "walk.bvh")
    check_person(clip, motion, tolerance=1e-5, lacking=("l toes", "r toes"))
    assert doubts(clip)[0].startswith("no names of legs were understood")


def test_a_spine_of_blender_ends_where_the_arms_branch_off(tmp_path):
    """Its bones are all called spine, up to the head."""
    spine = dict(zip(("hips", "spine", "chest", "neck", "head"), range(5), strict=True))
    names = {key: f"spine.{spine[key]:03}" if key in spine else name for key, name in MIXAMO.items()}
    (tmp_path / "walk.bvh").write_text(bvh_text(MOTION, names))
    clip = read_clip(tmp_path / "walk.bvh")
    own = to_canonical(clip)
    neck = own.joints()[:, 1 + own.skeleton.index("neck")]
    np.testing.assert_allclose(neck, in_our_axes(MOTION.place["neck"]), atol=1e-3)
    assert doubts(clip) == []


def test_ends_that_a_file_lacks_continue_the_bones_before_whatever_axes_joints_have(tmp_path, monkeypatch):
    """A zero pose of bones in all directions says nothing about them."""
    axes = dict(zip(KEYS, Rotation.random(len(KEYS), random_state=5), strict=True))
    monkeypatch.setattr(written_files, "own_axes", lambda: axes)
    (tmp_path / "walk.bvh").write_text(bvh_text(MOTION, LAFAN1, along_x=True))
    own = to_canonical(read_clip(tmp_path / "walk.bvh"))
    for start, bone, key in (("neck", "head", "neck"), ("lwri", "lhan", "l hand"), ("rwri", "rhan", "r hand")):
        ends = (own.joints()[:, 1 + own.skeleton.index(one)] for one in (start, bone))
        line, truth = next(ends) - next(ends), MOTION.place[key] - MOTION.place[key.replace("neck", "head") + " end"]
        assert np.median(dot(normalise(line), normalise(in_our_axes(truth)))) > np.cos(np.radians(15.0)), bone


@pytest.mark.parametrize("name", FILES)
def test_a_person_is_read_as_recorded(tmp_path, name):
    text, lacking = FILES[name]
    (tmp_path / "walk.bvh").write_text(text)
    clip = read_clip(tmp_path / "walk.bvh")
    check_person(clip, MOTION, tolerance=1e-5, lacking=lacking)
    assert landmarks_of(clip.skeleton).lacking == []
    assert doubts(clip) == []
    assert 0.8 < np.median(clip.root_position[:, 2]) < 1.1
    assert clip.rate == pytest.approx(60.0)
