"""The readers on the real recordings of CMU, HDM05 and Jaeger, against oracles that share no code with them."""

import numpy as np
import pytest
import scipy.io

from controller.motion.clip import ReadingOptions
from controller.motion.encodings.bone_directions import BoneDirections
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.formats.acclaim.amc import read_amc
from controller.motion.formats.acclaim.asf import read_asf
from controller.motion.formats.jaeger_patterns import read_pattern
from controller.motion.formats.reading import read_clip

CMU = ["02", "07", "08", "09", "10", "16", "35", "86"]
HDM05 = ["bd", "bk", "dg", "mm", "tr"]
PATTERNS = {  # frames in each file (Deliallisi 2017, table A.1, but for GetSeated, where it says 451)
    "ExaStride": 291,
    "SlowWalk": 241,
    "Walk": 320,
    "RunJog": 151,
    "CartWheel": 451,
    "Waltz": 900,
    "Crawl": 201,
    "Standup": 201,
    "Getdown": 241,
    "Sitting": 201,
    "GetSeated": 431,
    "StandupFromStool": 301,
    "Box1": 451,
    "Box2": 701,
    "Box3": 301,
}


def pairs(data, subject):
    """The skeleton of a subject and its recordings."""
    if subject in CMU:
        return data / "cmu" / subject / f"{subject}.asf", sorted((data / "cmu" / subject).glob("*.amc"))
    every = sorted(path for path in (data / "hdm05").glob("*/*") if path.suffix.lower() == ".amc")
    return data / "hdm05" / f"HDM_{subject}.asf", [path for path in every if path.name.startswith(f"HDM_{subject}_")]


def matrix(x, y, z):
    """Turns about x, then y, then z, degrees."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians([x, y, z])), np.sin(np.radians([x, y, z]))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def oracle(asf, amc, frames):
    """Joint positions by bone name in ASF units and axes, by 3 x 3 matrices, for files that write everything as XYZ.

    One dictionary for each of the frames.
    """
    text = asf.read_text("latin-1")
    bones = {}
    for block in text.split(":bonedata")[1].split(":hierarchy")[0].split("begin")[1:]:
        words = {line.split()[0]: line.split()[1:] for line in block.strip().splitlines()}
        vector = np.array(words["direction"][:3], float)
        vector *= float(words["length"][0]) / np.linalg.norm(vector)  # the file rounds its unit vectors
        assert words["axis"][3] == "XYZ"
        bones[words["name"][0]] = vector, matrix(*map(float, words["axis"][:3])), words.get("dof", [])
    lines = amc.read_text("latin-1").split(":DEGREES")[1].strip().splitlines()
    starts = [number for number, line in enumerate(lines) if line.strip().isdigit()]
    for frame in frames:
        of_frame = [line.split() for line in lines[starts[frame] + 1 : starts[frame] + 30]]
        values = {line[0]: np.array(line[1:], float) for line in of_frame}
        place = {"root": values["root"][:3]}
        turn = {"root": matrix(*values["root"][3:])}
        for line in text.split(":hierarchy")[1].strip().splitlines()[1:-1]:
            above, *below = line.split()
            for bone in below:
                vector, axis, dof = bones[bone]
                angles = dict(zip(dof, values.get(bone, []), strict=True))
                local = axis @ matrix(*(angles.get(channel, 0.0) for channel in ("rx", "ry", "rz"))) @ axis.T
                turn[bone] = turn[above] @ local
                place[bone] = place[above] + turn[bone] @ vector
        yield place


@pytest.mark.thorough
@pytest.mark.parametrize("subject", CMU + HDM05)
def test_forward_kinematics_agrees_with_matrices_from_the_definition(mocap_data, subject):
    asf, recordings = pairs(mocap_data, subject)
    skeleton = read_asf(asf)
    for amc in recordings[:3]:
        clip = read_amc(amc, skeleton)
        joints = dict(zip(("root", *clip.skeleton.bones), np.moveaxis(clip.joints(), 1, 0), strict=True))
        frames = np.linspace(0, len(clip) - 1, 4).astype(int)
        for frame, places in zip(frames, oracle(asf, amc, frames), strict=True):
            for bone, (x, y, z) in places.items():
                assert np.allclose(joints[bone][frame], np.array([z, x, y]) / 0.45 * 0.0254, atol=1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize("subject", CMU + HDM05)
def test_people_stand_on_the_ground_and_keep_their_bones(mocap_data, subject):
    asf, recordings = pairs(mocap_data, subject)
    for amc in recordings:
        clip = read_clip(amc, ReadingOptions(asf))
        joints = clip.joints()
        lengths = np.linalg.norm(joints[:, 1:] - joints[:, clip.skeleton.parent + 1], axis=-1)
        assert np.allclose(lengths, clip.skeleton.length, atol=1e-9)
        assert 0.8 < clip.skeleton.leg_length < 1.1
        lowest = joints[..., 2].min(axis=1)
        assert -0.05 < np.quantile(lowest, 0.2) < 0.1  # even those who jump stand a fifth of the time
        assert lowest.min() > -0.2
        assert np.abs(np.linalg.norm(clip.rotation, axis=-1) - 1.0).max() < 1e-9


@pytest.mark.parametrize("recording", ["02/02_01", "07/07_01", "08/08_01", "35/35_01"])
def test_walkers_walk_upright_forwards_and_at_a_walking_pace(mocap_data, recording):
    clip = read_clip(mocap_data / "cmu" / f"{recording}.amc")
    at = {bone: clip.joints()[:, 1 + clip.skeleton.index(bone)] for bone in clip.skeleton.bones}
    assert np.all(at["head"][:, 2] - np.maximum(at["lfoot"][:, 2], at["rfoot"][:, 2]) > 0.9)
    assert np.all(at["ltoes"][:, 2] < 0.5)
    channels = BoneDirections(clip.skeleton, "rhipjoint", "lhipjoint").encode(clip)
    assert 0.8 < np.median(channels[:, 2]) < 2.0  # forward, m/s
    assert abs(np.median(channels[:, 3])) < 0.15  # sideways


def test_the_longest_recording_arrives_whole(mocap_data):
    clip = read_clip(mocap_data / "cmu" / "86" / "86_01.amc")
    assert len(clip) == 4579
    assert clip.skeleton.name == "86"
    assert clip.duration == pytest.approx(38.16, abs=0.01)


def test_a_recording_without_its_skeleton_asks_for_it(mocap_data):
    from motiondeck_base.errors import FileFormatError

    with pytest.raises(FileFormatError, match=r"13_29\.amc: there are no \.asf files beside it"):
        read_clip(mocap_data / "cmu" / "13" / "13_29.amc")


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_pattern_encodes_to_the_channels_of_its_file(mocap_data, pattern):
    path = mocap_data / "jaeger" / f"nnRaw{pattern}.mat"
    clip = read_pattern(path)
    assert (clip.name, clip.rate, len(clip)) == (pattern, 120.0, PATTERNS[pattern])
    fields = scipy.io.loadmat(path)
    expected = fields[f"nnRawData{pattern}"] * np.array([1e-3, 120.0, 0.12, 0.12, *np.ones(57)])
    expected[:, [4, 16]] = 0.0
    assert np.allclose(BoneDirections(clip.skeleton).encode(clip)[1:], expected[1:], rtol=0.0, atol=1e-9)
    assert np.allclose(clip.skeleton.length, fields[f"segLengths{pattern}"][0] / 1000.0)
    assert -0.06 < clip.joints()[..., 2].min() < 0.06


def test_two_formats_of_one_take_agree_on_its_speed(mocap_data):
    """08_03 came to us as AMC (in inches / 0.45) and, by way of C3D and Jaeger, as a pattern (in mm)."""

    def speed(clip):
        return np.linalg.norm(clip.root_position[-1, :2] - clip.root_position[0, :2]) / (len(clip) - 1) * clip.rate

    pattern = read_clip(mocap_data / "jaeger" / "nnRawWalk.mat")
    recording = read_clip(mocap_data / "cmu" / "08" / "08_03.amc")
    assert speed(pattern) == pytest.approx(speed(recording), rel=0.005)


def test_all_patterns_together_normalise_and_come_back(mocap_data):
    clips = [read_pattern(mocap_data / "jaeger" / f"nnRaw{pattern}.mat") for pattern in PATTERNS]
    channels = [BoneDirections(clip.skeleton).encode(clip) for clip in clips]
    normalisation = Normalisation.fit(channels)
    assert np.flatnonzero(normalisation.scaling == 0.0).tolist() == [4, 16]
    for frames in channels:
        scaled = normalisation.apply(frames)
        assert np.abs(scaled).max() <= 1.0 + 1e-12
        assert np.allclose(normalisation.invert(scaled), frames, atol=1e-12)
