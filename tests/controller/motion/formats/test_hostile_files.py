"""Whatever bytes a file holds, a reader answers with a clip, a skeleton, or one line that names the file."""

import io

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from controller.motion.formats.acclaim.amc import read_amc
from controller.motion.formats.acclaim.asf import read_asf
from controller.motion.formats.bvh import read_bvh
from controller.motion.formats.jaeger_patterns import read_pattern
from controller.motion.formats.markers.c3d import read_c3d
from controller.motion.formats.reading import read_clip
from motiondeck_base.errors import MotiondeckError
from people import moving
from recordings import AMC, ASF, BVH, c3d_bytes, mat_bytes, pattern_fields
from written_files import gltf_file, mvnx_text, trc_text

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")


@st.composite
def mangled(draw, whole: bytes):
    """A valid file with some pieces overwritten, cut out, repeated or moved."""
    content = bytearray(whole)
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, max(0, len(content) - 1)))
        length = draw(st.integers(0, 40))
        match draw(st.sampled_from(["overwrite", "insert", "cut", "truncate", "repeat", "flip"])):
            case "overwrite":
                piece = draw(st.binary(min_size=1, max_size=8))
                content[place : place + len(piece)] = piece
            case "insert":
                content[place:place] = draw(st.binary(max_size=8) | st.sampled_from(TOKENS))
            case "cut":
                del content[place : place + length]
            case "truncate":
                del content[place:]
            case "repeat":
                content[place:place] = content[place : place + length]
            case "flip" if content:
                content[place] ^= 1 << draw(st.integers(0, 7))
    return bytes(content)


TOKENS = [
    b"1e308 ",
    b"-1e-320",
    b"nan",
    b"\n",
    b"\r",
    b":",
    b"root ",
    b"(",
    b"\xb2",
    b"\n99999999999999999999\n",
    b"begin\n",
    b"#",
]


def survive(read, path, content):
    path.write_bytes(content)
    try:
        return read(path)
    except MotiondeckError as error:
        message = str(error)
    assert str(path) in message or path.stem in message
    assert "\n" not in message
    assert len(message) < 1000
    return None


def check_clip(clip):
    assert np.isfinite(clip.joints()).all() or np.abs(clip.root_position).max() > 1e100
    assert clip.rotation.shape == (len(clip), 1 + len(clip.skeleton), 4)


@settings(max_examples=150)
@given(st.binary(max_size=300) | mangled(ASF.encode()))
@example(ASF.encode())
@example(b":root\norder\n:bonedata\n:hierarchy\n")
@example(b":root\norder\n:bonedata\nbegin\nname a\nname\nend\n:hierarchy\nroot a\n")
def test_any_skeleton_file(tmp_path, content):
    skeleton = survive(read_asf, tmp_path / "hostile.asf", content)
    if skeleton is not None:
        assert len(skeleton.dof) == len(skeleton.axis) == 1 + len(skeleton.skeleton)
        assert np.isfinite(skeleton.axis).all()


@settings(max_examples=150)
@given(st.binary(max_size=300) | mangled(AMC.encode()))
@example(AMC.encode())
@example(b"1\n")
@example(b"\xb2\nroot 0 0 0 0 0 0")
def test_any_recording(tmp_path, content):
    (tmp_path / "mannequin.asf").write_text(ASF)
    skeleton = read_asf(tmp_path / "mannequin.asf")
    clip = survive(lambda path: read_amc(path, skeleton), tmp_path / "hostile.amc", content)
    if clip is not None:
        check_clip(clip)


@settings(max_examples=150)
@given(mangled(ASF.encode()))
def test_any_skeleton_with_a_sound_recording(tmp_path, content):
    (tmp_path / "bow.amc").write_text(AMC)
    skeleton = survive(read_asf, tmp_path / "hostile.asf", content)
    if skeleton is not None:
        survive(lambda path: read_amc(tmp_path / "bow.amc", skeleton), tmp_path / "bow.amc", AMC.encode())


@settings(max_examples=150)
@given(st.binary(max_size=300) | mangled(BVH.encode()))
@example(BVH.encode())
@example(b"HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n}\nMOTION\nFrames: 1\nFrame Time: 1\n0\n")
@example(b"MOTION\nFrames: 1\nFrame Time: 1\n0\n")
def test_any_biovision_file(tmp_path, content):
    clip = survive(read_bvh, tmp_path / "hostile.bvh", content)
    if clip is not None:
        check_clip(clip)


SEEN = np.random.default_rng(0).normal(0.0, 900.0, (3, 5, 3))
LABELS = ["a:C7", "a:CLAV", "a:LKNE", "b:C7", "*5"]


@settings(max_examples=100)
@given(
    st.binary(max_size=300)
    | mangled(c3d_bytes(LABELS, SEEN))
    | mangled(c3d_bytes(LABELS, SEEN, processor=85, scale=0.5))
    | mangled(c3d_bytes(LABELS, SEEN, processor=86))
)
@example(c3d_bytes(LABELS, SEEN))
@example(c3d_bytes(LABELS, SEEN)[:700])
def test_any_marker_file(tmp_path, content):
    markers = survive(read_c3d, tmp_path / "hostile.c3d", content)
    if markers is not None:
        assert markers.position.shape[1:] == (len(markers.labels), 3)
        assert np.nanmax(np.abs(markers.position)) <= 1e4
        assert markers.rate > 0


@settings(max_examples=100)
@given(st.integers(0, 1500), st.binary(min_size=1, max_size=8))
def test_any_damage_to_header_and_parameters_of_a_marker_file(tmp_path, place, piece):
    content = bytearray(c3d_bytes(LABELS, SEEN))
    content[place : place + len(piece)] = piece
    survive(read_c3d, tmp_path / "hostile.c3d", bytes(content))


def npz_bytes(**arrays):
    content = io.BytesIO()
    np.savez(content, **arrays)
    return content.getvalue()


def npy_bytes(array):
    content = io.BytesIO()
    np.save(content, array)
    return content.getvalue()


SHORT = moving(frames=2)
WHOLE = {
    ".npz": npz_bytes(poses=np.ones((2, 66)), trans=np.ones((2, 3)), mocap_framerate=60.0),
    ".joints.npz": npz_bytes(joints=np.stack([*SHORT.place.values()], axis=1)[:, :22], fps=20.0),
    ".npy": npy_bytes(np.stack([*SHORT.place.values()], axis=1)[:, :22]),
    ".mvnx": mvnx_text(SHORT).encode(),
    ".trc": trc_text(["LKNE", "C7"], np.ones((2, 2, 3)), 60.0).encode(),
    ".glb": gltf_file(SHORT).glb(),
    ".gltf": gltf_file(SHORT).gltf().encode(),
    ".csv": b"time_s,root.x,root.y,root.z,a.x,a.y,a.z\n0,0,0,1,0,0,2\n0.1,0,0,1,0,0.1,2\n",
}


@pytest.mark.parametrize("suffix", WHOLE)
@settings(max_examples=40)
@given(data=st.data())
def test_any_file_of_the_newer_formats(tmp_path, suffix, data):
    content = data.draw(st.binary(max_size=300) | mangled(WHOLE[suffix]))
    clip = survive(read_clip, tmp_path / f"hostile{suffix}", content)
    if clip is not None:
        check_clip(clip)


@settings(max_examples=150)
@given(
    st.binary(max_size=300)
    | st.binary(max_size=300).map(lambda tail: b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + tail)
    | mangled(mat_bytes(pattern_fields(2)))
    | mangled(mat_bytes(pattern_fields(2), do_compression=True))
)
@example(mat_bytes(pattern_fields(2)))
@example(mat_bytes({"nnRawData": np.array([["cell", 1.0]], dtype=object)}))
@example(mat_bytes(pattern_fields(2)).replace(b"nnRawDataBow", b"nnRawData\n\xff."))
def test_any_mat_file(tmp_path, content):
    clip = survive(read_pattern, tmp_path / "hostile.mat", content)
    if clip is not None:
        check_clip(clip)


@settings(max_examples=150)
@given(st.integers(128, 600), st.binary(min_size=1, max_size=8))
def test_any_damage_to_the_headers_in_a_mat_file(tmp_path, place, piece):
    """The first few hundred bytes hold the kinds, sizes and names that a parser trusts most."""
    content = bytearray(mat_bytes(pattern_fields(2)))
    content[place : place + len(piece)] = piece
    clip = survive(read_pattern, tmp_path / "hostile.mat", bytes(content))
    if clip is not None:
        check_clip(clip)
