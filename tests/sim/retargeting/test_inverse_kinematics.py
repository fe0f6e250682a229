"""Tests of the inverse kinematics: it must find random poses of the robot again."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.deck.interfaces import JointLimits
from controller.motion.rest_pose import FOOT_SLOPE
from controller.motion.rotations import from_rotation_vector, normalise, rotate
from sim.models.joint_layout import JointLayout
from sim.models.model_file import read_model
from sim.retargeting.human_limbs import LIMBS
from sim.retargeting.inverse_kinematics import LimbSolver, sole
from sim.retargeting.robot_limbs import RobotLimbs, limb_directions
from sim.robots.body_matching import match
from small_robots import SERVOS, full_humanoid, humanoid

UP = np.array([0.0, 0.0, 1.0])
DT = 0.01
SIDES = {"r": "right", "l": "left"}


@pytest.fixture(scope="module")
def limbs(tmp_path_factory):
    path = tmp_path_factory.mktemp("ik") / "small.xml"
    path.write_text(humanoid())
    model = read_model(path).compile()
    found = match(path, model)
    return RobotLimbs(path, model, found.parts, found.root_rotation, tuple(SERVOS))


def solver_of(limbs):
    lower, upper = limbs.model.jnt_range[[limbs.model.joint(name).id for name in SERVOS]].T.copy()
    limits = JointLimits(lower, upper, *(np.full(len(SERVOS), rate) for rate in (4.0, 100.0, 1e4)))
    return LimbSolver(limbs, limits, np.clip(np.full(len(SERVOS), 0.1), lower, upper), DT), limits


def standing():
    """Limbs that hang and stand straight, feet ahead: the ankle is above the ball of the foot by FOOT_SLOPE."""
    foot = [np.cos(FOOT_SLOPE), 0.0, -np.sin(FOOT_SLOPE)]
    rows = {"foot": foot, "ahead": [1.0, 0.0, 0.0], "chest_left": [0.0, 1.0, 0.0], "head_left": [0.0, 1.0, 0.0]}
    return np.array([next((v for k, v in rows.items() if name.endswith(k)), [0.0, 0.0, -1.0]) for name in LIMBS])


def seen(limbs, q):
    """The directions of arms and legs of the robot itself, from where MuJoCo has the anchors of its joints."""
    model, data = limbs.model, mujoco.MjData(limbs.model)
    for name, angle in zip(SERVOS, q, strict=True):
        data.joint(name).qpos[0] = angle
    data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
    mujoco.mj_kinematics(model, data)
    out = standing()
    for side, name in SIDES.items():
        hip, knee, ankle = (data.joint(f"{name}_{joint}").xanchor for joint in ("hip_pitch", "knee", "ankle"))
        shoulder, elbow = data.joint(f"{name}_arm_roll").xanchor, data.joint(f"{name}_elbow").xanchor
        hand = data.body(f"{name}_fore").xmat.reshape(3, 3) @ [0.0, 0.0, -1.0]
        sole_turn = data.body(f"{name}_sole").xmat.reshape(3, 3)
        foot = sole_turn @ [np.cos(FOOT_SLOPE), 0.0, -np.sin(FOOT_SLOPE)]
        limbs_of = {"thigh": knee - hip, "shank": ankle - knee, "upper_arm": elbow - shoulder}
        for part, vector in {**limbs_of, "forearm": hand, "foot": foot}.items():
            out[LIMBS.index(f"{side}_{part}")] = normalise(np.array(vector))
    return out


def degrees_between(a, b):
    return np.degrees(np.arccos(np.clip((a * b).sum(-1), -1.0, 1.0)))


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1))
def test_a_pose_of_its_own_is_found_again(limbs, seed):
    random = np.random.default_rng(seed)
    solver, limits = solver_of(limbs)
    q = limits.lower + random.uniform(0.2, 0.8, len(SERVOS)) * (limits.upper - limits.lower)
    for side in ("left", "right"):
        q[SERVOS.index(f"{side}_arm_pitch")] = random.uniform(
            -1.5, 1.0
        )  # farther from rest another branch may be nearer
        for name in ("hip_yaw", "hip_roll", "ankle_roll"):  # a foot's roll is not the human's: it is kept level
            q[SERVOS.index(f"{side}_{name}")] = 0.0
    wanted = seen(limbs, q)
    there = seen(limbs, solver(wanted, UP))
    rows = [k for k, name in enumerate(LIMBS) if name[2:] in ("upper_arm", "forearm", "thigh", "shank")]
    assert degrees_between(wanted, there)[rows].max() < 0.5
    feet = [LIMBS.index("r_foot"), LIMBS.index("l_foot")]
    assert degrees_between(wanted, there)[feet].max() < 0.5


@pytest.mark.parametrize("side", ["r", "l"])
def test_a_foot_turned_out_turns_the_hip_and_stays_flat(limbs, side):
    solver, _ = solver_of(limbs)
    wanted = standing()
    row = LIMBS.index(f"{side}_foot")
    wanted[row] = rotate(from_rotation_vector(np.array([0.0, 0.0, 0.5])), wanted[row])
    q = dict(zip(SERVOS, solver(wanted, UP), strict=True))
    assert q[f"{SIDES[side]}_hip_yaw"] == pytest.approx(0.5, abs=0.05)
    for joint in ("hip_roll", "ankle", "ankle_roll"):
        assert abs(q[f"{SIDES[side]}_{joint}"]) < 0.06
    other = "left" if side == "r" else "right"
    assert abs(q[f"{other}_hip_yaw"]) < 0.05


def test_the_first_pose_is_answered_settled_and_later_ones_in_no_more_than_the_pace(limbs):
    solver, limits = solver_of(limbs)
    bent = standing()
    bent[[LIMBS.index("r_thigh"), LIMBS.index("r_forearm")]] = [[0.9, 0.0, -0.44], [0.9, 0.0, -0.44]]
    first = solver(bent, UP).copy()
    assert np.abs(solver(bent, UP) - first).max() < 1e-3
    path = np.array([solver(bent, UP).copy(), *(solver(standing(), UP).copy() for _ in range(80))])
    steps = np.abs(np.diff(path, axis=0))
    assert (steps <= limits.velocity * DT + 1e-12).all()
    assert steps[:20].max(axis=1) == pytest.approx(4.0 * DT)  # as fast as it may, until it is there
    solver.reset()
    assert path[-1] == pytest.approx(solver(standing(), UP), abs=5e-3)


def kicked_back():
    """Limbs of a body that stands, but for the right leg, which points straight back, as no hip of the robot can."""
    limbs = standing()
    limbs[[LIMBS.index("r_thigh"), LIMBS.index("r_shank")]] = [-1.0, 0.0, 0.0]
    return limbs


def test_what_is_out_of_range_ends_at_the_range_and_is_told(limbs):
    solver, limits = solver_of(limbs)
    q = solver.q
    for _ in range(3):
        q = solver(kicked_back(), UP)
        assert ((q >= limits.lower) & (q <= limits.upper)).all()
    hip = SERVOS.index("right_hip_pitch")
    assert q[hip] == pytest.approx(limits.upper[hip])
    limbs.place(q)
    start, end = limbs.positions()
    goal = limbs.reach["r_leg"] * np.array([-1.0, 0.0, 0.0])
    missed = np.linalg.norm(goal - (end - start)[solver.names.index("r_leg")])
    assert missed > 0.03
    errors = solver.shortfall()
    assert errors["r_leg"]["worst_m"] == pytest.approx(missed, rel=0.02)
    assert errors["r_leg"]["rms_m"] == pytest.approx(missed, rel=0.02)
    assert errors["l_leg"]["worst_m"] < 0.02


def test_after_a_reset_nothing_is_left_of_what_was_missed(limbs):
    solver, _ = solver_of(limbs)
    solver(kicked_back(), UP)
    solver.reset()
    assert solver.shortfall()["r_leg"] == {"rms_m": 0.0, "worst_m": 0.0}
    solver(standing(), UP)
    assert solver.shortfall()["r_leg"]["worst_m"] < 0.02


def test_numbers_gone_wrong_hold_the_joints(limbs):
    solver, _ = solver_of(limbs)
    before = solver(standing(), UP).copy()
    broken = standing()
    broken[LIMBS.index("r_thigh")] = np.nan
    assert np.array_equal(solver(broken, UP), before)
    assert solver(standing(), UP) == pytest.approx(before, abs=1e-3)


vectors = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.2)
directions = vectors.map(normalise)


def well_posed(thigh, shank, foot, up):
    """Whether the leg's two planes are there: neither foot nor knee lies along the shank, and none is upside down."""
    upright = max(-float(shank @ up), 0.0) ** 2
    left = upright * np.cross(up, foot) + (1.0 - upright) * np.cross(2.0 * thigh + foot, shank)
    left -= (left @ foot) * foot
    return np.linalg.norm(left) > 0.05


def left_of(axes):
    """Which way is left for a sole with axes ahead and up."""
    return np.cross(axes[1], axes[0])


@given(directions, directions, directions, directions, vectors)
def test_a_sole_turns_with_the_body_it_is_seen_from(thigh, shank, foot, up, turn):
    if not well_posed(thigh, shank, foot, up):
        return
    ahead, above = sole(thigh, shank, foot, up)
    left = np.cross(above, ahead)
    assert np.array([ahead @ ahead, left @ left, ahead @ left, foot @ left]) == pytest.approx([1, 1, 0, 0], abs=1e-9)
    assert ahead @ foot == pytest.approx(np.cos(FOOT_SLOPE))
    assert ahead @ np.cross(foot, left) == pytest.approx(np.sin(FOOT_SLOPE))  # the toes are lower than the ankle
    q = from_rotation_vector(3.0 * turn)
    turned = sole(*(rotate(q, v) for v in (thigh, shank, foot, up)))
    assert turned == pytest.approx(rotate(q, np.array([ahead, above])), abs=1e-4)
    mirror = np.array([1.0, -1.0, 1.0])
    mirrored = sole(*(v * mirror for v in (thigh, shank, foot, up)))
    assert mirrored == pytest.approx(np.array([ahead * mirror, above * mirror]), abs=1e-4)


def test_a_standing_leg_keeps_its_sole_level_and_a_lying_one_takes_it_along():
    ahead, level = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    knee_out = normalise(np.array([0.6, 0.6, -0.5]))
    assert left_of(sole(knee_out, -UP, ahead, UP)) == pytest.approx(level, abs=1e-5)
    # On the side, the knee bent ahead: left is across the leg's own plane, here straight down or up.
    lying = left_of(sole(normalise(np.array([1.0, 1.0, 0.0])), level, ahead, UP))
    assert lying == pytest.approx([0.0, 0.0, 1.0], abs=1e-5)
    # Half way between, shank 45 degrees to the side, it is between level and what the leg alone would have.
    shank, thigh = normalise(np.array([0.0, 1.0, -1.0])), normalise(np.array([0.5, 0.7, -0.7]))
    half = left_of(sole(thigh, shank, ahead, UP))
    assert degrees_between(half, level) == pytest.approx(45.0 / 2.0, abs=8.0)
    assert degrees_between(half, np.array([0.0, 1.0, 1.0]) / np.sqrt(2.0)) < 45.0


def test_a_leg_and_foot_in_one_line_have_no_side_and_still_get_one():
    down = np.array([0.0, 0.0, -1.0])
    axes = sole(down, down, down, UP)
    assert np.isfinite(axes).all()
    assert left_of(axes) == pytest.approx([0.0, 1.0, 0.0])


def test_a_trunk_does_not_bend_for_what_an_arm_cannot_reach(tmp_path):
    path = tmp_path / "full.xml"
    path.write_text(full_humanoid())
    model = read_model(path).compile()
    found = match(path, model)
    joints = JointLayout.of(model).joints
    limbs = RobotLimbs(path, model, found.parts, found.root_rotation, joints)
    count = len(joints)
    reach = np.array([0.3 if "elbow" in name or "shoulder" in name else 2.0 for name in joints])
    assert (reach < 1.0).sum() == 8
    limits = JointLimits(-reach, reach, *(np.full(count, rate) for rate in (8.0, 300.0, 1e4)))
    solve = LimbSolver(limbs, limits, np.zeros(count), DT)
    boxing = standing()
    for side in SIDES:
        for part in ("upper_arm", "forearm"):
            boxing[LIMBS.index(f"{side}_{part}")] = normalise(np.array([0.9, 0.0, 0.3]))
    for _ in range(60):
        limbs.place(solve(boxing, UP))
    assert np.degrees(np.arccos(limbs.chest_rotation()[2, 2])) < 2.0


SWUNG = {"lift": "1 0 0", "turn": "0 0 1"}
BALL = {"pitch": "0 1 0", **SWUNG}


def swung_shoulders(path, hinges, inwards=2.5, back=2.5):
    """Solver and limbs of a robot whose first arm hinges stand upright and carry the others along, 0.1 m beside.

    The arms are lifted inwards and panned back by no more than that, rad.
    """

    def with_these(text):
        for side, out in (("left", 0.1), ("right", -0.1)):
            ranges = {"lift": f"{-inwards} 2.5" if side == "left" else f"-2.5 {inwards}"}
            pan = f"-2.5 {back}" if side == "left" else f"{-back} 2.5"
            joints = "".join(
                f'<joint name="{side}_{k}" axis="{axis}" range="{ranges.get(k, "-2.5 2.5")}"/>'
                for k, axis in hinges.items()
            )
            first, others = (
                f'<joint name="{side}_arm_pitch" axis="0 1 0" range="-3.5 2.5"',
                f'<body name="{side}_upper">',
            )
            second = f'<joint name="{side}_arm_roll" axis="1 0 0" range="-2 2"/>'
            assert all(text.count(part) == 1 for part in (first, others, second))
            text = text.replace(first, f'<joint name="{side}_pan" axis="0 0 1" range="{pan}"').replace(second, joints)
            text = text.replace(others, f'<body name="{side}_upper" pos="0 {out} 0">')
        return text

    path.write_text(humanoid(servos=(), rename=with_these))
    model = read_model(path).compile()
    parts = {"pelvis": "trunk"} | {
        f"{side}_{part}": f"{name}_{body}"
        for side, name in SIDES.items()
        for part, body in {"thigh": "thigh", "shank": "shank", "upper_arm": "upper", "forearm": "fore"}.items()
    }
    joints = JointLayout.of(model).joints
    limbs = RobotLimbs(path, model, parts, np.array([1.0, 0.0, 0.0, 0.0]), joints)
    lower, upper = model.jnt_range[[model.joint(name).id for name in joints]].T.copy()
    limits = JointLimits(lower, upper, *(np.full(len(joints), rate) for rate in (4.0, 100.0, 1e4)))
    rest = np.array([0.2 if name in ("left_lift", "left_elbow", "right_elbow") else 0.0 for name in joints])
    rest[joints.index("right_lift")] = -0.2
    return LimbSolver(limbs, limits, rest, DT), limbs


def reaching():
    """Limbs of a body that stands and holds its arms out ahead."""
    limbs = standing()
    for side, left in (("r", -1.0), ("l", 1.0)):
        limbs[LIMBS.index(f"{side}_upper_arm")] = normalise(np.array([0.8, 0.5 * left, -0.2]))
        limbs[LIMBS.index(f"{side}_forearm")] = normalise(np.array([0.9, -0.1 * left, 0.3]))
    return limbs


def test_a_hinge_that_carries_the_shoulder_along_turns_an_arm_that_needs_it(tmp_path):
    solver, limbs = swung_shoulders(tmp_path / "swung.xml", SWUNG)
    limbs.place(solver(reaching(), UP))
    there = limb_directions(limbs)
    rows = [LIMBS.index(f"{side}_{part}") for side in "rl" for part in ("upper_arm", "forearm")]
    assert degrees_between(there, reaching())[rows].max() < 1.0


def test_a_clavicle_stays_where_it_is(tmp_path):
    solver, limbs = swung_shoulders(tmp_path / "ball.xml", BALL)
    limbs.place(solver(reaching(), UP))
    model, data = limbs.model, limbs.data
    turned = [data.qpos[model.joint(f"{side}_pan").qposadr[0]] for side in SIDES.values()]
    assert np.abs(turned).max() < 0.1
    there = limb_directions(limbs)
    rows = [LIMBS.index(f"{side}_{part}") for side in "rl" for part in ("upper_arm", "forearm")]
    assert degrees_between(there, reaching())[rows].max() < 3.0


def test_an_arm_that_cannot_follow_still_bends_in_the_plane_of_the_humans(tmp_path):
    """Elsewhere its elbow would be far from where it is needed as soon as the arm bends more."""
    solver, limbs = swung_shoulders(tmp_path / "swung.xml", SWUNG, inwards=0.0, back=0.5)
    behind = standing()
    for side, left in (("r", -1.0), ("l", 1.0)):
        behind[LIMBS.index(f"{side}_upper_arm")] = normalise(np.array([-0.35, -0.15 * left, -0.95]))
        behind[LIMBS.index(f"{side}_forearm")] = normalise(np.array([-0.1, 0.08 * left, -1.0]))
    for _ in range(150):
        limbs.place(solver(behind, UP))
    for side, name in SIDES.items():
        folds = limbs.data.xaxis[limbs.model.joint(f"{name}_elbow").id]
        across = np.cross(*(behind[LIMBS.index(f"{side}_{part}")] for part in ("upper_arm", "forearm")))
        assert folds @ normalise(across) > 0.95


def test_only_arms_that_can_choose_it_have_a_plane(limbs, tmp_path):
    names = swung_shoulders(tmp_path / "ball.xml", BALL)[1].vectors.names
    assert {"r_arm_plane", "l_arm_plane"} <= set(names)
    assert not any("plane" in name for name in limbs.vectors.names)  # two hinges a shoulder


def test_a_leg_does_not_lean_for_a_foot_on_tiptoe(limbs):
    """The human's heels are up by 1.2 rad; these ankles turn by 0.3."""
    _, limits = solver_of(limbs)
    ankles = [SERVOS.index(f"{name}_ankle") for name in SIDES.values()]
    limits.lower[ankles], limits.upper[ankles] = -0.3, 0.3
    solver = LimbSolver(limbs, limits, np.clip(np.zeros(len(SERVOS)), limits.lower, limits.upper), DT)
    goals = standing()
    for side in SIDES:
        goals[LIMBS.index(f"{side}_foot")] = [np.cos(FOOT_SLOPE + 1.2), 0.0, -np.sin(FOOT_SLOPE + 1.2)]
    there = seen(limbs, solver(goals, UP))
    for name in ("r_thigh", "r_shank", "l_shank"):
        assert there[LIMBS.index(name)] @ goals[LIMBS.index(name)] > np.cos(0.1)
