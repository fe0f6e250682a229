"""`motiondeck preflight` as its users run it."""

import json
import re
from dataclasses import replace

import msgspec
import pytest

import synthetic
from command_line import invoked
from controller.library.motion_library import save_library
from controller.library.recording_error import Errors, RecordingError
from simulated_bodies import human


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    path = tmp_path_factory.mktemp("library") / "small.safetensors"
    small = synthetic.small_library()
    errors = Errors(median=1.0, p95=2.0, worst=3.0, joint="lwri", worst_at_s=0.5)
    error = RecordingError(from_s=0.0, to_s=1.0, mm=errors, degrees=errors, own_body_mm=2.0)
    march, *others = small.info.motions
    motions = [msgspec.structs.replace(march, against_recording=error), *others]
    save_library(replace(small, info=msgspec.structs.replace(small.info, motions=motions)), path)
    return path


@pytest.fixture(autouse=True)
def nothing_is_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def preflight(*arguments):
    return invoked("preflight", *arguments, env={"COLUMNS": "220"})


@pytest.mark.thorough
def test_every_motion_and_every_switch_is_judged_and_the_exit_code_says_so(library, tmp_path):
    run = preflight(library, "--robot", "mannequin", "--json")
    said = json.loads(run.stdout)
    assert run.exit_code == (0 if said["ok"] else 1)
    assert [motion["name"] for motion in said["motions"]] == ["march", "wave", "bow"]
    assert said["motions"][0]["against_recording"]["mm"]["p95"] == 2.0
    assert said["motions"][1]["against_recording"] is None
    pairs = {f"{a} > {b}" for a in ("march", "wave", "bow") for b in ("march", "wave", "bow") if a != b}
    assert {switch["name"] for switch in said["switches"]} == pairs
    checks = {finding["check"] for finding in said["motions"][0]["findings"]}
    assert {"speed", "held back", "torque", "self-collision", "foot slide", "into the ground"} <= checks
    assert "off target" in checks


@pytest.mark.thorough
def test_the_table_names_what_is_wrong_and_the_tempo_that_passes(library):
    run = preflight(library, "--robot", "mannequin", "--motions-only", "--root", "free")
    assert run.exit_code == 1
    assert "off balance" in run.stdout
    line = next(line for line in run.stdout.splitlines() if line.startswith("march: "))
    assert "self-collision: " in line  # what no tempo mends
    assert re.search(r"\(carried \d, .*on its feet 0\)", run.stdout)
    assert "self-collision: `play --check-collisions` keeps" in run.stdout
    assert re.search(r"Torque is not judged for (\d+) of \1 joints: the robot's files give no limit", run.stdout)


def test_what_is_alike_is_one_line_with_the_worst_first_and_the_rest_is_counted(capsys):
    from motiondeck.cli.common.verdict_report import MOST_CAUSES, print_answers, print_causes
    from sim.robots.verdict import Finding, RobotVerdict

    def bent(depth, where):
        return Finding("self-collision", depth, 3.0, "mm", where, ok=False)

    alike = [(f"motion{depth}", bent(depth, "l_foot and r_foot")) for depth in (4, 9, 7, 5, 8)]
    print_causes([*alike, *((f"other{place}", bent(4.0, f"limb{place}")) for place in range(10))])
    first, *others, last = capsys.readouterr().out.splitlines()
    assert first == "  self-collision: l_foot and r_foot, 9 mm (limit 3 mm): motion9, motion8, motion7 and 2 more"
    assert len(others) == MOST_CAUSES - 1
    assert last == "  and 3 more causes, in 3"
    print_answers([RobotVerdict(name, (one,), None, obstacles=(one,)) for name, one in alike], "lib on bot")
    title, heading, line, *_ = capsys.readouterr().out.splitlines()
    assert (title, heading, line) == ("lib on bot: 5 do not fit (carried 0)", "no tempo mends:", first)


def test_what_no_tempo_mends_is_said_with_joint_number_cause_and_remedy(capsys):
    from motiondeck.cli.common.verdict_report import print_verdict, print_verdicts
    from sim.robots.verdict import REMEDIES, Finding, RobotVerdict

    weak = Finding("torque", 340.0, 100.0, "%", "l_knee", ok=False, cause="it needs 17 N m to carry its limb and has 5")
    verdict = RobotVerdict("squat", (weak,), None, obstacles=(weak,))
    print_verdict(verdict)
    print_verdicts([verdict], "lib on bot")
    line, rest = capsys.readouterr().out.split("\n", 1)
    assert line == "squat: does not fit (torque: l_knee, 340 %)"
    assert "it needs 17 N m to carry its limb and has 5" in rest
    assert "`effort` in a URDF" in rest
    assert "[servo] in the robot file" in rest
    assert "Heat is not judged" in rest
    assert all("\n" not in words for words in REMEDIES.values())


def test_what_was_judged_before_an_interruption_has_been_printed(library, monkeypatch):
    from sim.physics.preflight.preflight import Preflight

    judged, judge = [], Preflight.judge

    def judge_two(self, played, **how):
        if len(judged) == 2:
            raise KeyboardInterrupt
        judged.append(judge(self, played, **how))
        return judged[-1]

    monkeypatch.setattr(Preflight, "judge", judge_two)
    run = preflight(library, "--robot", "mannequin")
    assert run.exit_code != 0
    assert "march: " in run.stdout
    assert "wave: " in run.stdout
    assert "bow" not in run.stdout


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--tempo", "9"), "--tempo 9 is not between"),
        (("--balance",), "give --root free with --balance"),
        (("--walk",), "give --root free"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(library, arguments, complaint):
    run = preflight(library, *arguments, "--robot", "mannequin")
    assert run.exit_code == 1
    assert complaint in str(run.exception)


def test_what_has_no_feet_has_no_margin():
    import numpy as np

    from controller.loop.safety.safety_envelope import SafetyEnvelope
    from motiondeck_base.shipped import find_robot
    from sim.physics.loads import loads_of
    from sim.physics.played_motions import PlayedMotion
    from sim.physics.preflight.preflight import Preflight
    from sim.robots.robot import load_robot
    from sim.robots.self_collision import SelfCollision
    from simulated_bodies import bent_pose

    body = load_robot(find_robot("servo20"), human())
    motion = PlayedMotion("still", True, np.tile(body.rest, (3, 1)), (bent_pose(human()),) * 3)
    loads = loads_of(body, motion, free=False, collisions=SelfCollision(body), feet=())
    loads = replace(loads, support=(np.zeros((0, 2)),) * 3)
    found = Preflight(body, body.limits, SafetyEnvelope).static.standing(loads, 1.0)
    assert np.isfinite([finding.value for finding in found]).all()
    assert "balance margin" not in {finding.check for finding in found}


def test_currents_that_cannot_be_judged_are_mentioned(tmp_path, capsys):
    from motiondeck.run.verdicts import on_rig
    from motiondeck_base.shipped import find_rig, find_robot
    from sim.robots.robot import load_robot

    body = load_robot(find_robot("servo20"), human())
    rig = tmp_path / "rig.toml"
    rig.write_text(find_rig("servo20").read_text().replace("id = 1, ", "id = 1, current = 1.0,"))
    on_rig(replace(body, servo=None), rig)
    assert "current limits" in capsys.readouterr().err


def test_a_rig_narrows_what_is_allowed():
    from motiondeck.run.verdicts import on_rig
    from motiondeck_base.shipped import find_rig, find_robot
    from sim.robots.robot import load_robot

    body = load_robot(find_robot("servo20"), human())
    on_rig, limits = on_rig(body, find_rig("servo20"))
    assert (limits.velocity <= body.limits.velocity).all()
    assert limits.velocity.max() == 4.7
    assert on_rig.servo is not None
    assert on_rig.servo.hottest == 80.0
