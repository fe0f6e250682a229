import struct
import zlib

import numpy as np
import pytest

from controller.motion.encodings.bone_directions import BoneDirections
from controller.motion.formats import jaeger_patterns
from controller.motion.formats.jaeger_patterns import read_pattern
from controller.motion.skeleton import JAEGER_BONES, JAEGER_PARENT, JAEGER_REST, thesis_skeleton
from motiondeck_base.errors import FileFormatError
from recordings import mat_bytes, pattern_fields


@pytest.fixture
def read(tmp_path):
    """Writes bytes, or the fields of a MAT file, and reads them as a pattern."""

    def write_and_read(content, **options):
        path = tmp_path / "nnRawBow.mat"
        path.write_bytes(content if isinstance(content, bytes) else mat_bytes(content, **options))
        return read_pattern(path)

    return write_and_read


def complaint(read, content, **options):
    with pytest.raises(FileFormatError) as error:
        read(content, **options)
    message = str(error.value)
    assert "nnRawBow.mat" in message
    assert "\n" not in message
    return message


def test_the_skeleton_of_the_thesis_stands_with_its_arms_out():
    body = thesis_skeleton(np.ones(19))
    joints = body.joints(np.zeros(3), np.tile([1.0, 0.0, 0.0, 0.0], (20, 1)))
    at = dict(zip(JAEGER_BONES, joints[1:], strict=True))
    assert len(JAEGER_BONES) == len(JAEGER_PARENT) == len(JAEGER_REST) == 19
    assert at["rfoo"].tolist() == [1.0, -1.0, -2.0]
    assert at["lhan"].tolist() == [0.0, 4.0, 2.0]
    assert at["head"].tolist() == [0.0, 0.0, 3.0]


@pytest.mark.parametrize("compressed", [True, False])
def test_a_pattern_arrives_in_metres_and_seconds(read, compressed):
    clip = read(pattern_fields(), do_compression=compressed)
    assert (clip.name, clip.rate, clip.source, len(clip)) == ("Bow", 120.0, "nnRawBow.mat", 5)
    assert np.allclose(clip.skeleton.length, 0.1 + 0.01 * np.arange(19))
    assert np.allclose(clip.root_position[:, 2], 0.9 + 0.001 * np.arange(5))
    channels = BoneDirections(clip.skeleton).encode(clip)
    assert np.allclose(channels[:, 1:4], [1.2, 1.44, -0.12])
    assert np.array_equal(channels[:, [4, 16]], np.zeros((5, 2)))
    assert np.allclose(channels[:, 4:], np.ravel(JAEGER_REST))


def test_big_endian_files_are_read_too(read):
    def element(kind, data):
        return struct.pack(">II", kind, len(data)) + data + bytes(-len(data) % 8)

    def variable(name, values):
        flags = element(6, struct.pack(">II", 6, 0))
        shape = element(5, struct.pack(">ii", *values.shape))
        return element(14, flags + shape + element(1, name.encode()) + element(9, values.astype(">f8").tobytes("F")))

    header = b"MATLAB 5.0 MAT-file, made up".ljust(124) + b"\x01\x00MI"
    fields = {name: np.asarray(values) for name, values in pattern_fields().items()}
    content = header + b"".join(variable(name, values) for name, values in fields.items())
    assert np.allclose(read(content).root_position[:, 2], 0.9 + 0.001 * np.arange(5))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"nnRawDataBow": None}, "no field 'nnRawData' (there are: segLengthsBow, hmeanBow)"),
        ({"segLengthsBow": None}, "no field 'segLengthsBow' (there are: nnRawDataBow, hmeanBow)"),
        ({"nnRawDataBow": np.zeros((5, 60))}, "'nnRawDataBow' is 5 x 60 of double; expected frames x 61"),
        ({"nnRawDataBow": np.zeros((0, 61))}, "'nnRawDataBow' is 0 x 61 of double"),
        ({"nnRawDataBow": np.zeros((5, 61), np.float32)}, "of single"),
        ({"nnRawDataBow": np.zeros((5, 61), complex)}, "5 x 61 of complex"),
        ({"nnRawDataBow": np.zeros((5, 61, 2))}, "5 x 61 x 2"),
        ({"nnRawDataBow": {"a": 1}}, "of struct"),
        ({"nnRawDataBow": "walk"}, "of char"),
        ({"nnRawDataBow": np.full((1, 61), {}, dtype=object)}, "of cell"),
        ({"segLengthsBow": np.ones((1, 20))}, "'segLengthsBow' is 1 x 20 of double; expected 1 x 19"),
        ({"segLengthsBow": np.zeros((1, 19))}, "segLengthsBow holds a length"),
        ({"segLengthsBow": np.full((1, 19), np.inf)}, "not finite"),
        ({"nnRawDataBow": np.full((5, 61), np.nan)}, "not finite"),
        ({"nnRawDataBow": np.full((5, 61), 1e300)}, "further than 1 km"),
        ({"nnRawDataBow": np.zeros((5, 61))}, "frame 1: the direction of bone 'rhip' is no unit vector"),
    ],
)
def test_a_mat_file_with_other_fields_is_refused(read, change, said):
    fields = {name: values for name, values in (pattern_fields() | change).items() if values is not None}
    assert said in complaint(read, fields)


def test_a_direction_that_is_no_unit_vector_is_named(read):
    fields = pattern_fields()
    fields["nnRawDataBow"][3, 4 + 3 * 10 : 7 + 3 * 10] *= 1.001
    message = complaint(read, fields)
    assert "frame 4: the direction of bone 'head'" in message
    assert "(its length is 1.001)" in message


def test_hips_that_point_along_the_heading_are_refused(read):
    fields = pattern_fields()
    fields["nnRawDataBow"][2, 4:7] = [0.6, -0.8, 0.0]
    assert "frame 3: the direction of bone 'rhip'" in complaint(read, fields)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "empty"),
        (b"hello, I am a text file\n", "not a MAT file of version 5"),
        (b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512), "option -v7"),
        (b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM", "no field 'nnRawData' (there are: none)"),
        (mat_bytes(pattern_fields())[:-100], "damaged or cut short"),
        (mat_bytes(pattern_fields(), do_compression=True)[:-150], "damaged or cut short"),
        (mat_bytes(pattern_fields())[:200], "damaged or cut short"),
    ],
)
def test_other_files_are_refused(read, content, said):
    assert said in complaint(read, content)


def test_a_file_that_is_missing_is_refused(tmp_path):
    with pytest.raises(FileFormatError, match=r"gone\.mat: cannot be read \(No such file"):
        read_pattern(tmp_path / "gone.mat")


def test_a_file_that_is_too_large_is_refused(read, monkeypatch):
    monkeypatch.setattr(jaeger_patterns, "LARGEST", 1000)
    assert "larger than" in complaint(read, pattern_fields())


def test_a_small_file_may_not_unpack_to_a_huge_one(read):
    packed = zlib.compress(bytes(100 * 2**20))
    content = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(packed)) + packed
    assert len(content) < 2**20
    assert "unpacks to more than 64 MiB" in complaint(read, content)
