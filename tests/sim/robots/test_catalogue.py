"""A robot of the catalogue is known by its name wherever a robot is named."""

import sys
from types import SimpleNamespace

import pytest

from motiondeck_base.errors import MotiondeckError, UnknownNameError
from sim.robots import catalogue
from sim.robots.catalogue import find_robot
from sim.robots.robot import load_robot
from simulated_bodies import human
from small_robots import calibrated, humanoid


class CannotDownload(Exception):
    pass


@pytest.fixture
def menagerie(tmp_path, monkeypatch):
    """A catalogue of one robot, whose downloads are counted."""
    downloads = []

    def xml(name):
        downloads.append(name)
        (tmp_path / "menagerie").mkdir(exist_ok=True)
        path = tmp_path / "menagerie" / "walker.xml"
        path.write_text(humanoid())
        return path

    robot = SimpleNamespace(name="some_walker", xml=xml, default_model="walker", category="humanoid", license="MIT")
    package = SimpleNamespace(
        robots=lambda: [robot], get=lambda name: robot, MenagerieError=CannotDownload, downloads=downloads
    )
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", package)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("sim.robots.calibrate.calibrate", calibrated)
    return package


def test_a_robot_of_the_catalogue_is_downloaded_and_calibrated_once(menagerie, tmp_path, capsys):
    file = find_robot("some_walker")
    assert len(load_robot(file, human()).joints) == 18
    assert "edit " + str(file) in capsys.readouterr().err
    file.write_text(file.read_text().replace("velocity = 10.0", "velocity = 4.0"))
    assert find_robot("some_walker") == file  # as it was edited
    assert load_robot(file, human()).limits.velocity.max() == 4.0
    assert len(menagerie.downloads) == 1
    assert capsys.readouterr().err == ""
    (tmp_path / "menagerie" / "walker.xml").unlink()
    assert load_robot(find_robot("some_walker"), human()).limits.velocity.max() == 10.0
    assert len(menagerie.downloads) == 2


def test_shipped_robots_and_files_are_found_as_before(menagerie):
    assert find_robot("servo20").name == "servo20.toml"
    with pytest.raises(MotiondeckError, match="there is no such file"):
        find_robot("./some_walker.toml")
    assert menagerie.downloads == []


@pytest.mark.parametrize("installed", [True, False])
def test_another_name_is_refused(menagerie, monkeypatch, installed):
    if not installed:
        monkeypatch.setitem(sys.modules, "mujoco_menagerie", None)
    with pytest.raises(UnknownNameError, match="'some_talker'" + ".*some_walker" * installed):
        find_robot("some_talker")


def test_a_download_that_fails_is_named(menagerie, monkeypatch):
    def fails(name):
        raise CannotDownload("no network")

    monkeypatch.setattr(menagerie.get(""), "xml", fails)
    with pytest.raises(MotiondeckError, match=r"some_walker: cannot be downloaded \(no network\)"):
        catalogue.model_file("some_walker")
