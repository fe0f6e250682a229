import json
import resource
import shutil
import weakref

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from safetensors import safe_open
from safetensors.numpy import save_file

import synthetic
from controller.learning.trainers.echo_state import EchoStateRecipe
from controller.library.motion_library import MotionLibrary, load_library, once_a_library, save_library
from motiondeck.cli.common.tables import show_table
from motiondeck.cli.main import main
from motiondeck_base.errors import FileFormatError, MotiondeckError
from motiondeck_base.words import printable


@pytest.fixture(scope="module")
def library():
    return synthetic.small_library()


@pytest.fixture(scope="module")
def saved(library, tmp_path_factory):
    path = tmp_path_factory.mktemp("library") / "small.safetensors"
    save_library(library, path)
    return path


def contents(path):
    with safe_open(path, framework="numpy") as file:
        return {name: file.get_tensor(name) for name in file.keys()}, dict(file.metadata())  # noqa: SIM118


def rewritten(saved, tmp_path, change):
    """A copy of a library after `change(arrays, header)`."""
    arrays, metadata = contents(saved)
    header = json.loads(metadata["motiondeck"])
    change(arrays, header)
    path = tmp_path / "changed.safetensors"
    save_file(arrays, path, metadata={"motiondeck": json.dumps(header)})
    return path


def played(library, motion, frames=60):
    network = library.network.twin()
    network.cue(motion, 0)
    return synthetic.run(network, frames)


def test_a_library_plays_the_same_after_saving_and_loading(library, saved):
    loaded = load_library(saved)
    assert loaded.info == library.info
    for motion in library.network.motions:
        assert np.array_equal(played(loaded, motion), played(library, motion))


def test_an_echo_state_library_survives_too(library, tmp_path):
    taught, normalisation = synthetic.lessons()
    network = synthetic.trained(EchoStateRecipe(neurons=120), taught, normalisation)
    info = msgspec.structs.replace(library.info, network="echo-state", leak=0.6)
    path = tmp_path / "echo.safetensors"
    save_library(MotionLibrary(info, network, library.encoding), path)
    loaded = load_library(path)
    assert np.array_equal(played(loaded, "wave"), played(MotionLibrary(info, network, library.encoding), "wave"))


@pytest.fixture(scope="module")
def phase_library():
    return synthetic.small_phase_library(piece_seconds=0.5)


@pytest.fixture(scope="module")
def phase_echo_state_library():
    return synthetic.small_phase_echo_state_library(piece_seconds=0.5)


@pytest.mark.parametrize("kind", ["phase_library", "phase_echo_state_library"])
def test_a_phase_driven_library_plays_the_same_after_saving_and_loading(kind, tmp_path, request):
    phase_library = request.getfixturevalue(kind)
    save_library(phase_library, tmp_path / "phase.safetensors")
    loaded = load_library(tmp_path / "phase.safetensors")
    assert loaded.info == phase_library.info
    for motion in loaded.network.motions:
        assert np.array_equal(played(loaded, motion, 200), played(phase_library, motion, 200))


def test_a_library_of_the_first_version_still_plays(library, saved, tmp_path):
    def first_version(arrays, header):
        header["version"] = 1
        del header["scales"]
        arrays["memory/estimate"] = np.zeros((28, 100), dtype=np.float32)  # with which motions were added

    loaded = load_library(rewritten(saved, tmp_path, first_version))
    assert np.array_equal(played(loaded, "march"), played(library, "march"))


@pytest.mark.parametrize(
    ("change", "error"),
    [
        (lambda arrays, header: header.update(scales=None), "no scales"),
        (lambda arrays, header: header["scales"].update(neurons=7), "7 neurons in its header"),
        (lambda arrays, header: header["scales"].update(harmonics=10**9), "no weights can be drawn"),
        (lambda arrays, header: header.update(seed=-1), "no weights can be drawn"),
        (lambda arrays, header: arrays["motion/bow/held"].fill(-1), "-1 frames held"),
        (lambda arrays, header: arrays.pop("motion/bow/held"), "motion/bow/held.*missing"),
        (lambda arrays, header: arrays["motion/wave/mean"].fill(np.inf), "not finite"),
    ],
)
def test_what_is_wrong_with_a_phase_driven_library_is_named(phase_library, tmp_path, change, error):
    save_library(phase_library, tmp_path / "phase.safetensors")
    with pytest.raises(FileFormatError, match=error):
        load_library(rewritten(tmp_path / "phase.safetensors", tmp_path, change))


@pytest.mark.parametrize(
    ("change", "error"),
    [
        (lambda arrays, header: header.update(scales=None), "no scales"),
        (lambda arrays, header: header["scales"].update(neurons=7), "motion/march/readout"),
        (lambda arrays, header: arrays["motion/bow/held"].fill(1000), "1000 frames held"),
        (lambda arrays, header: arrays["motion/wave/readout"].fill(np.nan), "not finite"),
    ],
)
def test_what_is_wrong_with_a_phase_driven_echo_state_library_is_named(
    phase_echo_state_library, tmp_path, change, error
):
    save_library(phase_echo_state_library, tmp_path / "phase.safetensors")
    with pytest.raises(FileFormatError, match=error):
        load_library(rewritten(tmp_path / "phase.safetensors", tmp_path, change))


def test_nothing_is_left_beside_a_library(saved):
    assert [path.name for path in saved.parent.iterdir()] == ["small.safetensors"]


def test_a_folder_that_is_not_there_is_named(library, tmp_path):
    with pytest.raises(FileFormatError, match="cannot be written"):
        save_library(library, tmp_path / "nowhere" / "x.safetensors")


def test_two_libraries_from_one_file_do_not_share_their_state(saved):
    library = load_library(saved)
    first, second = library.network.twin(), library.network.twin()
    first.cue("march", 0)
    second.cue("march", 0)
    out = np.empty((2, first.channels))
    for _ in range(5):
        first.advance(out[0])
    first.cue("march", 0)
    first.advance(out[0])
    second.advance(out[1])
    assert np.array_equal(out[0], out[1])


def nan_in(arrays, header):
    arrays["motion/march/bias"][3] = np.nan


def wrong_shape(arrays, header):
    arrays["motion/wave/project"] = arrays["motion/wave/project"][:, :-1].copy()


def wrong_type(arrays, header):
    arrays["motion/wave/rest"] = arrays["motion/wave/rest"].astype(np.float64)


def missing(arrays, header):
    del arrays["motion/bow/readout"]


def surplus(arrays, header):
    arrays["motion/extra/bias"] = np.zeros(3, dtype=np.float32)


def future(arrays, header):
    header["version"] = 99


def unknown_key(arrays, header):
    header["motons"] = []


def bad_tree(arrays, header):
    header["skeleton"]["parent"][0] = 5


def no_hip(arrays, header):
    header["skeleton"]["right_hip"] = "hip"


def twice(arrays, header):
    header["motions"][1]["name"] = "march"


def no_rate(arrays, header):
    header["rate"] = 0.0


def bursting(arrays, header):
    arrays["motion/march/readout"][:] = 1e30


def giant(arrays, header):
    header["skeleton"]["length"][2] = 1e12


def giant_body(arrays, header):
    header["motions"][1]["body"] = header["skeleton"] | {"length": [50.0] * len(header["skeleton"]["length"])}


def body_of_others(arrays, header):
    bones = ["hip", *header["skeleton"]["bones"][1:]]
    header["motions"][1]["body"] = header["skeleton"] | {"bones": bones}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (giant_body, r"body of motion 'wave': bone 'rhip' is 50 m long"),
        (body_of_others, r"body of motion 'wave' has bones of another skeleton"),
        (nan_in, r"motion/march/bias.*not finite"),
        (wrong_shape, r"motion/wave/project.*expected float32 of shape \(30, 300\)"),
        (wrong_type, r"motion/wave/rest.*float64"),
        (missing, r"motion/bow/readout.*missing"),
        (surplus, r"motion/extra/bias.*nothing needs"),
        (future, r"format version 99"),
        (unknown_key, r"unknown key 'motons'.*Did you mean 'motions'"),
        (bad_tree, r"bone 'rhip' does not follow its parent"),
        (no_hip, r"hip bone 'hip'"),
        (twice, r"names no motion, or one twice"),
        (no_rate, r"rate 0.0"),
        (bursting, r"motion 'march' reads out .*, which no body does"),
        (giant, r"bone '\w+' is 1e\+12 m long, which no body has"),
    ],
)
def test_what_is_wrong_with_a_library_is_named(saved, tmp_path, change, says):
    path = rewritten(saved, tmp_path, change)
    with pytest.raises(FileFormatError, match=says) as caught:
        load_library(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_no_name_in_a_file_can_command_the_terminal(saved, tmp_path, capsys, monkeypatch):
    def rename(arrays, header):
        header["acknowledgement"] = "walk\x1b]0;owned\x07\x1b[2J\u202e"

    path = rewritten(saved, tmp_path, rename)
    monkeypatch.setattr("sys.argv", ["motiondeck", "library", "show", str(path)])
    with pytest.raises(SystemExit):
        main()
    said = capsys.readouterr().err
    assert "control characters in 'walk\\x1b]0;owned\\x07" in said
    assert set("\x1b\x07\u202e").isdisjoint(said)
    show_table(["a\x1b[31m"], [["b\x9b2J"]], title="c\x07")
    assert "b\\x9b2J" in capsys.readouterr().out
    assert printable("tab\tand\nnewline \u00e9") == "tab\tand\nnewline \u00e9"


def test_other_files_are_refused(tmp_path):
    other = tmp_path / "other.safetensors"
    save_file({"a": np.zeros(3)}, other)
    with pytest.raises(FileFormatError, match="not a motion library"):
        load_library(other)
    other.write_bytes(b"")
    with pytest.raises(FileFormatError, match="not a safetensors file"):
        load_library(other)
    with pytest.raises(FileFormatError, match="no such file"):
        load_library(tmp_path / "none.safetensors")
    with pytest.raises(FileFormatError, match="no such file"):
        load_library(tmp_path)


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_mangled_bytes_never_do_worse_than_an_error(saved, tmp_path, data):
    content = bytearray(saved.read_bytes())
    header = 8 + int.from_bytes(content[:8], "little")
    for _ in range(data.draw(st.integers(1, 6))):
        place = data.draw(st.integers(0, header - 1) | st.integers(0, len(content) - 1))
        content[place] = data.draw(st.integers(0, 255))
    if data.draw(st.booleans()):
        del content[data.draw(st.integers(0, len(content))) :]
    path = tmp_path / "mangled.safetensors"
    path.write_bytes(content)
    try:
        library = load_library(path)
    except MotiondeckError:
        return
    for motion in library.network.motions:
        library.network.cue(motion, 0)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=400))
def test_random_bytes_are_refused(tmp_path, content):
    path = tmp_path / "random.safetensors"
    path.write_bytes(content)
    with pytest.raises(MotiondeckError):
        load_library(path)


def test_a_library_is_never_half_written(library, saved, tmp_path):
    """A limit on the size of files stands in for a full disk."""
    path = tmp_path / "kept.safetensors"
    shutil.copy(saved, path)
    before = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(FileFormatError, match=r"kept\.safetensors: cannot be written .* Check folder and free"):
            save_library(library, path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["kept.safetensors"]


def test_what_is_found_once_a_library_is_found_again_for_another_and_forgotten_with_it():
    found = []

    @once_a_library
    def name_of(library):
        found.append(library.info.name)
        return library.info.name

    first, second = synthetic.small_library(), synthetic.small_library()
    assert name_of(first) == name_of(first) == name_of(second)
    assert len(found) == 2
    forgotten = weakref.ref(first)
    del first
    assert forgotten() is None
