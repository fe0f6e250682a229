"""Verdicts are made once and kept, and say the same everywhere: preflight, library, learn, page and play."""

import json
import shutil

import numpy as np
import pytest

import synthetic
from command_line import invoked, motiondeck
from controller.library.motion_library import save_library
from motiondeck.run import verdicts as module
from motiondeck.run.verdicts import Judged
from motiondeck_base.shipped import find_robot
from sim.robots.verdict import Finding, RobotVerdict

SLOW = Finding("held back", 0.314, 0.17, "rad", "l_knee", ok=False)
DEEP = Finding("self-collision", 12.0, 3.0, "mm", "l_foot and r_foot", ok=False)
MADE = {
    "march": RobotVerdict("march", (SLOW,), 0.538),
    "wave": RobotVerdict("wave", (Finding("off target", 0.05, 0.17, "rad", "neck"),), 1.0),
    "bow": RobotVerdict("bow", (DEEP,), None, obstacles=(DEEP,)),
}
WORDS = {
    "march": "at tempo 0.54 (held back: l_knee, 0.31 rad)",
    "wave": "plays",
    "bow": "does not fit (self-collision: l_foot and r_foot, 12 mm)",
}


@pytest.fixture
def judged(tmp_path, monkeypatch):
    """A library on a robot, whose judge counts the motions and needs no time."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    save_library(synthetic.small_library(), tmp_path / "small.safetensors")
    shutil.copy(find_robot("mannequin"), tmp_path / "bot.toml")
    made = []
    monkeypatch.setattr(module, "_judge", lambda judged, name: made.append(name) or [MADE.get(name, MADE["wave"])])
    found = Judged.of(tmp_path / "small.safetensors", tmp_path / "bot.toml")
    object.__setattr__(found, "made", made)
    return found


def anew(judged, **changes):
    """The same judgement in a later process."""
    settings = {"library": judged.library, "robot": judged.robot} | changes
    return Judged(**settings)


def test_verdicts_are_made_once(judged):
    assert not judged.kept()
    assert [*judged.motions([*MADE])] == [*MADE.values()]
    assert (judged.robot.parent / "bot.verdicts.json").is_file()
    assert [*anew(judged).motions(["bow", "march"])] == [MADE["bow"], MADE["march"]]
    assert anew(judged).kept() == MADE
    assert judged.made == ["march", "wave", "bow"]


@pytest.mark.parametrize("changed", ["library", "robot", "tempo", "root", "code"])
def test_what_a_verdict_depends_on_makes_it_anew(judged, changed, monkeypatch):
    assert [*judged.motions(["march"])]
    settings = {}
    if changed == "library":
        save_library(synthetic.small_library(seed=1), judged.library)
    elif changed == "robot":
        judged.robot.write_text(judged.robot.read_text() + "\n")
    elif changed == "code":
        monkeypatch.setattr("sim.robots.robot_digest.code_digest", lambda *_: b"another")
    else:
        settings = {"tempo": {"tempo": 0.5}, "root": {"root": "free"}}[changed]
    later = anew(judged, **settings)
    assert not later.kept()
    assert [*later.motions(["march"])] == [MADE["march"]]
    assert judged.made == ["march", "march"]


@pytest.mark.parametrize("content", [b"", b"{", b'{"a": {"b": [{"name": 1}]}}', b"\xff\xfe\x00", b'{"a": 3}'])
def test_a_damaged_file_is_made_anew(judged, content):
    assert [*judged.motions(["march"])]
    (judged.robot.parent / "bot.verdicts.json").write_bytes(content)
    assert anew(judged).kept() == {}
    assert [*anew(judged).motions(["march"])] == [MADE["march"]]
    assert anew(judged).kept() == {"march": MADE["march"]}


def test_what_was_made_before_an_interruption_is_kept(judged, monkeypatch):
    def two(_, name):
        if name == "bow":
            raise KeyboardInterrupt
        return [MADE[name]]

    monkeypatch.setattr(module, "_judge", two)
    with pytest.raises(KeyboardInterrupt):
        [*judged.motions([*MADE])]
    assert [*anew(judged).kept()] == ["march", "wave"]
    assert not [file for file in judged.robot.parent.iterdir() if file.name.startswith(".bot")]


def test_a_shipped_robots_verdicts_are_in_the_users_cache(judged):
    shipped = anew(judged, robot=find_robot("mannequin"))
    assert [*shipped.motions(["march"])]
    assert not (shipped.robot.parent / "mannequin.verdicts.json").exists()
    assert (judged.robot.parent / "cache" / "motiondeck" / "verdicts" / "mannequin.verdicts.json").is_file()


def test_a_mesh_that_changes_changes_the_robot(tmp_path):
    from sim.robots.robot_digest import robot_digest

    (tmp_path / "meshes").mkdir()
    mesh, robot = tmp_path / "meshes" / "Hand.STL", tmp_path / "m.toml"
    limits = "velocity = 1.0\nacceleration = 1.0\njerk = 1.0\n"
    robot.write_text(f'name = "m"\nkind = "humanoid"\nmodel = "m.xml"\n[limits]\n{limits}')
    inside = '<include file="more.xml"/><asset><mesh file="hand.stl"/></asset>'
    (tmp_path / "m.xml").write_text(f'<mujoco><compiler meshdir="meshes"/>{inside}</mujoco>')
    found = set()
    for content in (b"one", b"two"):
        mesh.write_bytes(content)
        found.add(robot_digest(robot))
        (tmp_path / "more.xml").write_text(f"<mujoco><!-- {content.hex()} --></mujoco>")
        found.add(robot_digest(robot))
    assert len(found) == 4


def test_the_words_are_the_same_at_preflight_library_page_and_play(judged):
    library, robot = str(judged.library), str(judged.robot)
    said = invoked("preflight", library, "--robot", robot, "--motions-only")
    assert [line for line in said.stdout.splitlines() if ": " in line][:3] == [f"{n}: {w}" for n, w in WORDS.items()]
    said = json.loads(invoked("preflight", library, "--robot", robot, "--motions-only", "--json").stdout)
    assert {row["name"]: row["words"] for row in said["motions"]} == WORDS
    said = json.loads(invoked("library", "show", library, "--robot", robot, "--json").stdout)
    rows = {row["name"]: row for row in said["verdicts"]}
    assert {name: row["words"] for name, row in rows.items()} == WORDS
    assert judged.made == ["march", "wave", "bow"]

    play = ("play", "--library", library, "--robot", robot, "--kinematic", "--headless", "--command-port", "0")
    run = motiondeck(*play, "--script", "march 0.05, wave 0.05")
    sums = "1 play, 1 at a slower tempo, 1 do not fit"
    assert f"small on mannequin, 3 judged: {sums}. march: {WORDS['march']}" in run.stderr
    assert f"march: {WORDS['march']}" in run.stdout
    run = motiondeck(*play, "march", "--seconds", "0.05", "--json")
    assert json.loads(run.stdout)["verdicts"] == [rows["march"]]


def test_the_page_has_the_same_words(judged):
    from contextlib import ExitStack

    from controller.deck.deck import Deck
    from motiondeck.run.page.page import PageContents
    from motiondeck.run.robots.robot_on_deck import open_robots
    from motiondeck.run.spec.run_spec import RunSpec

    library, spec = synthetic.small_library(), RunSpec(physics=False)
    assert [*judged.motions([*MADE])]
    with ExitStack() as opening:
        robots = open_robots(opening, spec, library)
        deck = Deck(library, robots[0].retarget, "march")
        contents = PageContents(
            deck, robots, None, None, 0, None, None, None, learns=False, verdicts=anew(judged).kept()
        )
        about = contents.description([judged.library], None)
    assert {name: words for name, (_, words) in about.verdicts.items()} == WORDS
    assert about.verdicts["march"][0] == "at tempo 0.54"


@pytest.mark.thorough
def test_learn_says_it_too(judged, tmp_path):
    from controller.motion.clip import Clip
    from controller.motion.formats.writing import write_clip
    from simulated_bodies import human, smooth_poses

    poses = smooth_poses(human(), np.random.default_rng(1), 240, reach=0.4)
    clip = Clip(
        "bow", human(), 60.0, *(np.array([getattr(p, k) for p in poses]) for k in ("root_position", "rotation"))
    )
    write_clip(clip, tmp_path / "bow.bvh")
    out = tmp_path / "bow.safetensors"
    words = ("learn", tmp_path / "bow.bvh", "--robot", judged.robot, "--as", "once", "--accept", "all")
    run = motiondeck(*words, "--out", out, "--json")
    assert [row["words"] for row in json.loads(run.stdout)["verdicts"]] == [WORDS["bow"]]
    run = motiondeck(*words, "--out", out, "--force")
    assert "does not fit" in run.stdout
    assert "self-collision: `play --check-collisions` keeps" in run.stdout
