"""A motion is taken out of a library, and nothing else changes."""

import msgspec
import numpy as np
import pytest

import synthetic
from controller.library.motion_library import BakedFrom, MotionLibrary, load_library, save_library, without_motion
from motiondeck.cli.main import main
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.shipped import find_library


def library_of(network):
    """A library of the synthetic motions in a network of some kind."""
    library = synthetic.small_library()
    motions = [{"name": motion.name, "file": f"{motion.name}.bvh"} for motion in library.info.motions]
    fields = {"leak": getattr(network, "leak", 1.0), **network.header_fields()}
    info = msgspec.structs.replace(library.info, network=network.kind, recipe={"motions": motions}, **fields)
    return MotionLibrary(info, network, library.encoding)


@pytest.mark.parametrize("kind", synthetic.NETWORKS)
def test_a_motion_is_removed_and_nothing_else_changes(kind, tmp_path):
    save_library(library_of(synthetic.NETWORKS[kind]()), tmp_path / "whole.safetensors")
    whole = load_library(tmp_path / "whole.safetensors")
    save_library(without_motion(whole, "wave"), tmp_path / "fewer.safetensors")
    fewer = load_library(tmp_path / "fewer.safetensors")
    assert fewer.network.motions == ("march", "bow")
    assert [motion["name"] for motion in fewer.info.recipe["motions"]] == ["march", "bow"]
    before, after = whole.network.arrays(), fewer.network.arrays()
    assert set(after) == {name for name in before if not name.startswith("motion/wave/")}
    assert all(np.array_equal(after[name], before[name]) for name in after)
    for motion in fewer.network.motions:
        runs = []
        for network in (whole.network.twin(), fewer.network):
            network.cue(motion, 0)
            runs.append(synthetic.run(network, 80))
        assert np.array_equal(*runs)


def test_a_baked_library_has_no_way_by_a_motion_that_is_gone():
    whole = synthetic.small_library()
    names = whole.network.motions
    leaps = {one: dict.fromkeys(names, 0.1) for one in names}
    baked = BakedFrom(robot="r", robot_digest="", library="l", library_digest="", leaps=leaps)
    whole = MotionLibrary(msgspec.structs.replace(whole.info, baked=baked), whole.network, whole.encoding)
    assert without_motion(whole, "bow").info.baked.leaps == {
        one: {"march": 0.1, "wave": 0.1} for one in ("march", "wave")
    }


def test_the_last_motion_and_unknown_ones_are_not_removed():
    library = synthetic.small_library()
    with pytest.raises(UnknownNameError, match="wave"):
        without_motion(library, "wav")
    alone = without_motion(without_motion(library, "wave"), "bow")
    with pytest.raises(MotiondeckError, match="'march' is the only motion"):
        without_motion(alone, "march")


def test_the_command_changes_its_own_file_and_no_shipped_one(tmp_path, capsys, monkeypatch):
    path = tmp_path / "mine.safetensors"
    save_library(synthetic.small_library(), path)
    before = find_library("thesis15").read_bytes()
    for library, motion, code in ((str(path), "wave", 0), ("thesis15", "walk", 1)):
        monkeypatch.setattr("sys.argv", ["motiondeck", "library", "remove", library, motion])
        with pytest.raises(SystemExit) as ended:
            main()
        assert (ended.value.code or 0) == code
    assert load_library(path).network.motions == ("march", "bow")
    assert "give --out FILE" in capsys.readouterr().err
    assert find_library("thesis15").read_bytes() == before
