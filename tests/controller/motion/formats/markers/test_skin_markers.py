"""Markers of many sets on a body whose joints are known give back its joints; what is missing is assumed or named."""

from dataclasses import replace

import numpy as np
import pytest
from test_marker_fit import worn

from controller.motion.canonical.body_doubts import doubts
from controller.motion.canonical.canonical_body import is_canonical, to_canonical
from controller.motion.clip import Markers
from controller.motion.formats.markers.c3d import read_c3d
from controller.motion.formats.markers.joint_points import jointed_body
from controller.motion.formats.markers.marker_fit import fit_markers
from controller.motion.formats.markers.skin_markers import joints_under_skin
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import dot, normalise
from controller.motion.skeleton import JAEGER_BONES
from motiondeck_base.errors import FileFormatError
from recordings import c3d_bytes
from written_files import trc_text

LABELS, PLACES, JOINTS = worn(prefix="")
WORN = dict(zip(LABELS, np.moveaxis(PLACES, 1, 0), strict=True))
TRUE = dict(zip(("root", *JAEGER_BONES), np.moveaxis(JOINTS, 1, 0), strict=True))
LIMBS = {"kne": "KNE", "ank": "ANK", "elb": "ELB"}


def inside(side, joint):
    """Where a marker on the other side of a joint would be."""
    return 2.0 * TRUE[side.lower() + joint] - WORN[side + LIMBS[joint]]


# What each landmark is called by: Vicon's legs, Motek's HBM, Rizzoli as Qualisys has it, OpenSim, OpenCap, OptiTrack.
VICON = "{s}ASI {s}PSI {s}KNE {s}ANK {s}HEE {s}TOE"
MOTEK = "{s}ASIS {s}PSIS {s}LEK {s}LM {s}HEE {s}MT2 {s}MEK {s}MM"
QUALISYS = "{s}_IAS {s}_IPS {s}_FLE {s}_FAL {s}_FCC {s}_FM2 {s}_FME {s}_TAM"
OPENSIM = "{s}.ASIS {s}.PSIS {s}.Knee.Lat {s}.Ankle.Lat {s}.Heel {s}.Toe {s}.Knee.Med {s}.Ankle.Med"
OPENCAP = (
    "{s}.ASIS_study {s}.PSIS_study {s}_knee_study {s}_ankle_study {s}_calc_study {s}_toe_study {s}_mknee_study "
    "{s}_mankle_study"
)
OPTITRACK = "x_Waist{s}Front x_Waist{s}Back x_{s}KneeOut x_{s}AnkleOut x_{s}HeelBack x_{s}ToeOut"
WORDS = "{side}Asis {side}Psis {side}LateralKnee {side}LateralAnkle {side}Heel {side}Toe"
SETS = {
    "Vicon": VICON,
    "Motek": MOTEK,
    "Qualisys": QUALISYS,
    "OpenSim": OPENSIM,
    "OpenCap": OPENCAP,
    "OptiTrack": OPTITRACK,
    "words": WORDS,
}


def legs(names):
    """The markers of both legs in a set: label to places (T, 3)."""
    found = {}
    for side in "LR":
        places = [*(WORN[side + name] for name in ("FWT", "BWT", "KNE", "ANK", "HEE", "TOE"))]
        places += [inside(side, "kne"), inside(side, "ank")]
        labels = names.format(s=side, side={"L": "Left", "R": "Right"}[side]).split()
        found |= dict(zip(labels, places[: len(labels)], strict=True))
    return found


def markers_of(places, up="z"):
    return Markers(tuple(places), 120.0, np.stack([*places.values()], axis=1), up, "worn.c3d")


@pytest.mark.parametrize("name", SETS)
def test_the_joints_of_legs_are_found_in_any_set(name):
    """From its outside alone a knee is guessed: how the foot is turned tells which way is inwards. Here feet turn."""
    found = joints_under_skin(markers_of(legs(SETS[name])))
    for side in "lr":
        for joint in ("hip", "kne", "ank"):
            off = np.linalg.norm(found[side + joint] - TRUE[side + joint], axis=-1)
            assert off.max() < 0.045, (name, side, joint)


@pytest.mark.parametrize("name", ["Motek", "Qualisys", "OpenSim", "OpenCap"])
def test_between_two_markers_a_joint_is_found_exactly(name):
    found = joints_under_skin(markers_of(legs(SETS[name])))
    for side in "lr":
        for joint in ("kne", "ank"):
            np.testing.assert_allclose(found[side + joint], TRUE[side + joint], atol=1e-9)


def test_legs_alone_make_a_body_whose_arms_are_assumed(tmp_path):
    places = legs(MOTEK)
    (tmp_path / "gait.c3d").write_bytes(c3d_bytes([*places], 1000.0 * np.stack([*places.values()], axis=1)))
    clip = read_clip(tmp_path / "gait.c3d")
    assert any("no neck, head" in doubt or "upper arm" in doubt for doubt in doubts(clip))
    own = to_canonical(clip)
    joints = dict(zip(("root", *JAEGER_BONES), np.moveaxis(own.joints(), 1, 0), strict=True))
    for bone, parent in (("kne", "hip"), ("ank", "kne")):
        for side in "lr":
            ours = normalise(joints[side + bone] - joints[side + parent])
            theirs = normalise(TRUE[side + bone] - TRUE[side + parent])
            assert np.degrees(np.arccos(np.clip(dot(ours, theirs), -1.0, 1.0))).max() < 6.0, side + bone


def test_arms_of_which_there_is_nothing_hang():
    markers = markers_of(legs(MOTEK) | {"C7": WORN["C7"], "CLAV": WORN["CLAV"]})
    own = to_canonical(jointed_body(joints_under_skin(markers), markers, "gait"))
    joints = dict(zip(("root", *JAEGER_BONES), np.moveaxis(own.joints(), 1, 0), strict=True))
    up = normalise(joints["neck"] - joints["root"])
    for side in "lr":
        arm = normalise(joints[side + "wri"] - joints[side + "sho"])
        assert (dot(arm, up) < -0.9).all()
        assert own.skeleton.length[JAEGER_BONES.index(side + "elb")] < 0.5 * own.skeleton.leg_length


def test_the_pelvis_turns_as_its_markers_do():
    """A trunk that leans says nothing about it."""
    clip = jointed_body(joints_under_skin(markers_of(legs(MOTEK))), markers_of(legs(MOTEK)), "gait")
    leaning = legs(MOTEK) | {"C7": TRUE["neck"] + [0.5, 0.0, -0.2], "CLAV": TRUE["neck"] + [0.6, 0.0, -0.2]}
    other = jointed_body(joints_under_skin(markers_of(leaning)), markers_of(leaning), "gait")
    assert np.abs(dot(clip.rotation[:, 0], other.rotation[:, 0])).min() > 1.0 - 1e-9


def test_a_whole_set_with_markers_inside_makes_the_canonical_body():
    places = legs(OPENSIM)
    for side in "LR":
        arm = {"Acromium": "SHO", "Elbow.Lat": "ELB", "Wrist.Lat": "WRA", "Wrist.Med": "WRB"}
        places |= {f"{side}.{name}": WORN[side + marker] for name, marker in arm.items()}
        places[f"{side}.Elbow.Med"] = inside(side, "elb")
    places |= {"C7": WORN["C7"], "Sternum": WORN["CLAV"], "Top.Head": WORN["LFHD"]}
    found = markers_of(places)
    clip = jointed_body(joints_under_skin(found), found, "whole")
    assert is_canonical(clip.skeleton)
    for side in "lr":
        for joint, most in (("sho", 0.03), ("elb", 0.02), ("wri", 0.02)):
            off = np.linalg.norm(joints_under_skin(found)[side + joint] - TRUE[side + joint], axis=-1)
            assert np.median(off) < most, side + joint


@pytest.mark.parametrize("up", ["z", "y"])
def test_up_is_found_and_gaps_are_bridged(tmp_path, up):
    places = np.stack([*legs(VICON).values()], axis=1)
    places = places if up == "z" else places[..., [1, 2, 0]]
    places[3:6, 4] = np.nan
    (tmp_path / "gait.trc").write_text(trc_text([*legs(VICON)], places, 60.0))
    clip = read_clip(tmp_path / "gait.trc")
    assert np.isfinite(clip.joints()).all()
    ankles = [1 + clip.skeleton.index(f"{side}Leg") for side in ("Left", "Right")]
    below = clip.joints()[:, :1, 2] - clip.joints()[:, ankles, 2]
    assert np.median(below) > 0.5


def test_of_two_people_the_one_with_more_markers_is_taken():
    whole = {f"eva:{label}": place for label, place in legs(VICON).items()}
    part = {f"zoe:{label}": place + 3.0 for label, place in list(legs(VICON).items())[:4]}
    found = joints_under_skin(markers_of(part | whole))
    np.testing.assert_allclose(found["lank"], joints_under_skin(markers_of(legs(VICON)))["lank"])


def test_a_name_may_stand_before_a_label():
    named = {f"Eva_{label}": place for label, place in legs(VICON).items()}
    assert "rkne" in joints_under_skin(markers_of(named))


def test_a_sacrum_serves_for_the_back_of_the_pelvis():
    places = {label: place for label, place in legs(VICON).items() if "PSI" not in label}
    places["SACR"] = 0.5 * (WORN["LBWT"] + WORN["RBWT"])
    found = joints_under_skin(markers_of(places))
    np.testing.assert_allclose(found["lhip"], joints_under_skin(markers_of(legs(VICON)))["lhip"], atol=1e-9)


def test_computed_centres_are_taken_as_they_are():
    places = legs(VICON) | {"V_L.Hip_JC": TRUE["lhip"] + 0.01, "RKJC": TRUE["rkne"] - 0.01}
    found = joints_under_skin(markers_of(places))
    np.testing.assert_allclose(found["lhip"], TRUE["lhip"] + 0.01)
    np.testing.assert_allclose(found["rkne"], TRUE["rkne"] - 0.01)


def test_a_missing_joint_is_named():
    places = {label: place for label, place in legs(VICON).items() if label != "LANK"}
    with pytest.raises(FileFormatError, match=r"worn\.c3d: .* the left ankle none that is known .* --rename OLD=LKNE"):
        joints_under_skin(markers_of(places))


def test_without_a_pelvis_there_is_nothing():
    assert joints_under_skin(markers_of({"LKNE": WORN["LKNE"], "RKNE": WORN["RKNE"]})) == {}


def test_points_in_the_joints_of_legs_alone_are_read(tmp_path):
    places = {
        f"{side}{name}": TRUE[side.lower() + joint]
        for side in "LR"
        for name, joint in (("Hip", "hip"), ("Knee", "kne"), ("Ankle", "ank"))
    }
    (tmp_path / "legs.trc").write_text(trc_text([*places], np.stack([*places.values()], axis=1), 60.0))
    clip = read_clip(tmp_path / "legs.trc")
    assert not is_canonical(clip.skeleton)
    off = (
        to_canonical(clip).joints()[:, 1 + JAEGER_BONES.index("lank")]
        - clip.joints()[:, 1 + clip.skeleton.index("LeftLeg")]
    )
    assert np.abs(off).max() < 0.02


def test_a_person_cut_down_to_another_set_keeps_the_legs(mocap_data):
    """CMU's markers under OpenSim's names, and only those of the legs, beside the fit to all of them."""
    whole = read_c3d(mocap_data / "c3d" / "08_04_slowwalk.c3d")
    whole = replace(whole, position=whole.position[:200])
    names = {"FWT": "ASIS", "BWT": "PSIS", "KNE": "Knee.Lat", "ANK": "Ankle.Lat", "HEE": "Heel", "TOE": "Toe"}
    places = {}
    for index, label in enumerate(whole.labels):
        marker = label.rpartition(":")[2]
        if marker[1:] in names:
            places[f"{marker[0]}.{names[marker[1:]]}"] = whole.position[:, index]
    cut = Markers(tuple(places), whole.rate, np.stack([*places.values()], axis=1), whole.up, "cut.c3d")
    ours = to_canonical(jointed_body(joints_under_skin(cut), cut, "cut")).joints()
    fitted = fit_markers(whole, "whole").clip.joints()
    for bone, parent in (("kne", "hip"), ("ank", "kne")):
        for side in "lr":
            one, other = (
                normalise(j[:, 1 + JAEGER_BONES.index(side + bone)] - j[:, 1 + JAEGER_BONES.index(side + parent)])
                for j in (ours, fitted)
            )
            assert np.median(np.degrees(np.arccos(np.clip(dot(one, other), -1.0, 1.0)))) < 3.0, side + bone
