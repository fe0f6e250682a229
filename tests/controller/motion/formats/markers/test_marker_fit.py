"""Markers worn by a body whose bones are known give back that body's joints and bones."""

import re

import numpy as np
import pytest

from controller.motion.clip import Markers
from controller.motion.formats.markers.c3d import read_c3d
from controller.motion.formats.markers.marker_fit import (
    ANKLE,
    BONE_OF,
    ELBOW,
    HIP,
    KNEE,
    SHOULDER,
    fit_markers,
    misplaced,
)
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import conjugate, rotate
from controller.motion.skeleton import JAEGER_BONES
from controller.motion.up_axis import TO_OURS
from motiondeck_base.errors import FileFormatError
from recordings import c3d_bytes
from simulated_bodies import human, smooth_poses

HALF_HIPS = 0.09  # of the made-up human
WIDTH = HALF_HIPS / HIP[1]  # between the waist markers of someone with these hips

# Where each marker sits in the rest pose (arms out sideways), from the start of its bone.
ON_LEFT = {
    "FWT": (-HIP[0] * WIDTH, 0.5 * WIDTH, -HIP[2] * WIDTH),
    "BWT": (-HIP[0] * WIDTH - 0.2, 0.05, -HIP[2] * WIDTH),
    "THI": (0.03, 0.08, -0.25),
    "KNE": (0.0, KNEE, -0.45),
    "SHN": (0.02, 0.05, -0.2),
    "ANK": (0.0, ANKLE, -0.43),
    "HEE": (-0.06, 0.0, -0.02),
    "TOE": (0.16, 0.0, 0.0),
    "MT5": (0.12, 0.05, -0.01),
    "SHO": (0.0, 0.17, SHOULDER),
    "UPA": (-0.05, 0.15, 0.02),
    "ELB": (-ELBOW, 0.32, 0.0),
    "FRM": (0.03, 0.12, 0.03),
    "WRA": (0.03, 0.26, 0.0),
    "WRB": (-0.03, 0.26, 0.0),
    "FIN": (0.0, 0.07, 0.0),
    "FHD": (0.1, 0.07, 0.19),
    "BHD": (-0.1, 0.07, 0.19),
}
ON_TRUNK = {
    "C7": (-0.06, 0.0, 0.22),
    "CLAV": (0.06, 0.0, 0.22),
    "T10": (-0.1, 0.0, 0.0),
    "STRN": (0.1, 0.0, 0.0),
    "RBAC": (-0.1, -0.08, 0.1),
}


def worn(frames=40, seed=3, prefix="eva:"):
    """A human who moves, and the 41 markers on it: labels, positions (T, M, 3) in m, and the true joints (T, 20, 3)."""
    body = human()
    poses = smooth_poses(body, np.random.default_rng(seed), frames, reach=0.5)
    position = np.array([pose.root_position for pose in poses])
    rotation = np.array([pose.rotation for pose in poses])
    for hip in ("rhip", "lhip"):
        rotation[:, 1 + body.index(hip)] = rotation[:, 0]
    joints = body.joints(position, rotation)
    labels, tracks = [], []
    for marker, bone in BONE_OF.items():
        offset = np.array(ON_TRUNK[marker] if marker in ON_TRUNK else ON_LEFT[marker[1:]])
        if marker not in ON_TRUNK and marker[0] == "R":
            offset = offset * [1.0, -1.0, 1.0]
        index = -1 if bone == "root" else body.index(bone)
        start = joints[:, 0 if index < 0 else 1 + int(body.parent[index])]
        labels.append(prefix + marker)
        tracks.append(start + rotate(rotation[:, 1 + index], offset))
    return labels, np.stack(tracks, axis=1), joints


def markers_of(labels, positions, up="z"):
    return Markers(tuple(labels), 120.0, positions, up, "worn.c3d")


def test_joints_bones_and_markers_come_back():
    labels, positions, joints = worn()
    fit = fit_markers(markers_of(labels, positions), "eva")
    assert fit.clip.skeleton.bones == JAEGER_BONES
    assert np.sqrt(np.nanmean(fit.residual**2)) < 0.01
    off = np.linalg.norm(fit.clip.joints() - joints, axis=-1)
    assert off.mean() < 0.02
    np.testing.assert_allclose(fit.clip.skeleton.length, human().length, atol=0.03)


def test_markers_lost_for_a_while_are_bridged_by_the_body():
    labels, positions, joints = worn()
    holes = positions.copy()
    random = np.random.default_rng(5)
    for marker in range(len(labels)):
        at = int(random.integers(0, 30))
        holes[at : at + 8, marker] = np.nan
    fit = fit_markers(markers_of(labels, holes), "eva")
    assert np.isnan(fit.residual).sum() == 8 * len(labels)
    assert np.linalg.norm(fit.clip.joints() - joints, axis=-1).mean() < 0.025


def test_a_marker_taken_for_another_pulls_little():
    labels, positions, _ = worn()
    swapped = positions.copy()
    knees = [labels.index("eva:LTHI"), labels.index("eva:RTHI")]
    swapped[10:14, knees] = swapped[10:14, knees[::-1]]
    plain, pulled = (fit_markers(markers_of(labels, p), "eva").clip.joints() for p in (positions, swapped))
    assert np.linalg.norm(positions - swapped, axis=-1).max() > 0.19
    assert np.linalg.norm(plain - pulled, axis=-1).max() < 0.05


@pytest.mark.parametrize("said", [True, False])
def test_y_may_be_up(said):
    labels, positions, joints = worn()
    lying = rotate(conjugate(TO_OURS["y"]), positions)
    fit = fit_markers(markers_of(labels, lying, "y" if said else None), "eva")
    assert np.linalg.norm(fit.clip.joints() - joints, axis=-1).mean() < 0.02


def test_other_people_and_other_names(tmp_path):
    labels, positions, _ = worn()
    gait = [label.replace("FWT", "ASI").replace("BWT", "PSI").replace("SHN", "TIB") for label in labels]
    labels_of_two = ["zoe:C7", "zoe:CLAV", *gait, "eva:C7-1"]
    both = np.concatenate([positions[:, :2] + 5.0, positions, positions[:, :1] + 9.0], axis=1)
    (tmp_path / "two.C3D").write_bytes(c3d_bytes(labels_of_two, 1000.0 * both))
    clip = read_clip(tmp_path / "two.C3D")
    assert (clip.name, clip.rate, clip.source) == ("two", 120.0, "two.C3D")
    plain = fit_markers(markers_of(labels, positions), "eva").clip
    np.testing.assert_allclose(clip.joints(), plain.joints(), atol=1e-3)


def test_labels_that_are_exchanged_for_a_part_of_the_recording_are_doubted():
    labels, positions, _ = worn(frames=60)
    assert misplaced(fit_markers(markers_of(labels, positions), "eva")) == []
    ankles = [labels.index("eva:LANK"), labels.index("eva:RANK")]
    positions[45:, ankles] = positions[45:, ankles[::-1]]
    (said,) = misplaced(fit_markers(markers_of(labels, positions), "eva"))
    assert re.match(r"marker '[LR]ANK' is up to \d\.\d\d m off .* in 25\.0 % of the frames, first at 0\.38 s", said)


def test_what_is_missing_is_named():
    labels, positions, _ = worn(frames=3)
    labels[labels.index("eva:LKNE")] = "eva:knee"
    positions[:, labels.index("eva:C7")] = np.nan
    with pytest.raises(FileFormatError, match=r"worn\.c3d: no marker is called LKNE \(there are"):
        fit_markers(markers_of(labels, positions), "eva")


@pytest.mark.parametrize("subject", ["Eva_2_", "Eva 2:", "eva-", "eva.", "eva|"])
def test_the_subject_may_stand_before_any_sign(subject):
    labels, positions, _ = worn(frames=3)
    plain = fit_markers(markers_of(labels, positions), "eva").clip
    named = fit_markers(markers_of([label.replace("eva:", subject) for label in labels], positions), "eva").clip
    np.testing.assert_array_equal(named.joints(), plain.joints())


@pytest.mark.thorough
def test_people_are_fitted_to_within_their_skin(mocap_data):
    """CMU's run, of which the ASF skeleton of the same take is known: its legs, within what two fits of one differ."""
    fit = fit_markers(read_c3d(mocap_data / "c3d" / "02_03_runjog.c3d"), "run")
    assert len(fit.markers) == 41
    assert np.sqrt(np.nanmean(fit.residual**2)) < 0.006
    theirs = read_clip(mocap_data / "cmu" / "02" / "02_03.amc").skeleton
    ours = fit.clip.skeleton
    for bone, name in (("rkne", "rfemur"), ("rank", "rtibia"), ("lkne", "lfemur"), ("lank", "ltibia")):
        assert ours.length[ours.index(bone)] == pytest.approx(theirs.length[theirs.index(name)], abs=0.045)


def test_a_marker_that_was_never_seen_is_called_so():
    labels, positions, _ = worn(frames=3)
    positions[:, labels.index("eva:LKNE")] = np.nan
    with pytest.raises(FileFormatError, match=r"worn\.c3d: never seen in this recording: LKNE\."):
        fit_markers(markers_of(labels, positions), "worn")


def test_markers_that_are_on_no_body_are_refused():
    """Labels that change from frame to frame, as where a tracker has lost the person."""
    labels, positions, _ = worn(frames=20)
    positions = np.random.default_rng(2).permuted(positions, axis=1)
    with pytest.raises(FileFormatError, match=r"worn\.c3d: the markers lie \d+ mm off the body .*--rename"):
        fit_markers(markers_of(labels, positions), "worn")
