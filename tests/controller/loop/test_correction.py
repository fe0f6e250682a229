"""A correction learns what shafts are off by motion and phase, from joints that are free to follow and no others."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.simulated_time import VirtualClock
from controller.deck.interfaces import JointLimits
from controller.deck.locks.phase_lock import LoopPlace
from controller.loop.correction import LARGEST, Correction
from controller.loop.lead import Lead
from controller.loop.loop import run
from controller.loop.output_channel import Channel
from controller.loop.safety.safety_envelope import SafetyEnvelope

DT, JOINTS, ROUND = 0.005, 3, 1.2
LIMITS = JointLimits(*(np.full(JOINTS, x) for x in (-2.0, 2.0, 6.0, 100.0, 6000.0)))
LAG = 0.04
SAG = np.array([0.0, 0.02, -0.05])


class Loops:
    """A deck of two loops of sines, at a tempo; between them it fades for half a second."""

    def __init__(self):
        self.motion, self.phase, self.tempo, self.time, self.fade = "walk", 0.0, 1.0, 0.0, 0.0
        self.blended = False

    @property
    def place(self):
        alone = self.fade <= 0.0
        return None if self.blended else LoopPlace(self.time, self.motion, self.phase, ROUND, True, self.tempo, alone)

    def switch(self, motion):
        self.motion, self.fade = motion, 0.5

    def update(self, dt):
        self.time += dt
        self.fade -= dt
        self.phase = (self.phase + self.tempo * dt / ROUND) % 1.0
        turn, other = 2.0 * np.pi * self.phase, float(self.motion == "jog")
        return np.array([0.5 * np.sin(turn), 0.3 * np.cos(2.0 * turn), 0.2 + 0.08 * np.sin(turn + other)]), self


class Still(Loops):
    """Loops that stand where they were at first."""

    def update(self, dt):
        super().update(dt)
        return np.array([0.0, 0.3, 0.2]), self


class Shafts:
    """Joints that follow their targets with a time constant, sag, and may be jammed; every second tick is measured."""

    name, every = "shafts", 2

    def __init__(self):
        self.lag = np.full(JOINTS, LAG)
        self.at, self.written, self.measured_at = np.zeros(JOINTS), [], []
        self.correction, self.jammed, self.free = None, np.zeros(JOINTS, bool), np.ones(JOINTS, bool)
        self._measured, self._ticks = [], 0

    def write(self, targets, pose):
        self._ticks += 1
        if self.correction is not None and len(self._measured) >= self.every and self._ticks % self.every == 0:
            self.correction.learn(self._measured[-self.every], self.every * DT, self.free)
        self.written.append(targets.copy())
        self._measured.append(self.at.copy())
        moved = self.at + DT / LAG * (targets + SAG - self.at)
        self.at = np.where(self.jammed, self.at, moved)

    def measured(self):
        return self._measured[-1] if self._measured else None

    def report(self):
        return {}


class Stage:
    """A run whose ticks are commanded by hand; `shown` is the picture, and `shafts` where joints were meanwhile."""

    def __init__(self, tables=None, *, learns=True, limits=LIMITS):
        self.limits = limits
        self.deck, self.joints, self.shown, self.shafts = Loops(), Shafts(), [], []
        channel = Channel(self.joints)
        lead = Lead([channel], JOINTS, DT)
        tables = {} if tables is None else tables
        self.correction = Correction(lambda: self.deck.place, lead.delays, lead.seconds, limits, DT, tables)
        if learns:
            self.joints.correction = self.correction
        self.channel = channel

    def play(self, seconds, commands=None):
        """Plays, and calls `commands(stage, tick, stop)` before each tick."""
        tick = iter(range(10**6))

        def carry_out(stop):
            now = next(tick)
            if commands is not None:
                commands(self, now, stop)
            if now >= seconds / DT:
                stop.ask("enough")

        def publish(state):
            self.shown.append(state.targets.copy())
            self.shafts.append(self.joints._measured[-1])

        correction = self.correction if self.joints.correction is not None else None
        envelope = SafetyEnvelope(self.limits, DT)
        self.report = run(
            self.deck,
            [self.channel],
            VirtualClock(1.0 / DT),
            envelope,
            commands=carry_out,
            publish=publish,
            publish_every=1,
            correction=correction,
        )
        return self

    def errors(self, rounds, until=0.0):
        """RMS of each joint over the last rounds before `until` s before the end."""
        end = len(self.shown) - round(until / DT) - 30
        part = slice(end - round(rounds * ROUND / DT), end)
        return np.sqrt(np.square(np.array(self.shown)[part] - np.array(self.shafts)[part]).mean(axis=0))


@pytest.fixture(scope="module")
def learned():
    return Stage().play(14.0)


def test_what_is_left_after_the_lead_is_learned_and_the_picture_is_as_before(learned):
    plain = Stage(learns=False).play(14.0)
    assert (learned.errors(2) < 0.25 * plain.errors(2)).all()
    assert np.allclose(np.array(learned.shown)[:2700], np.array(plain.shown)[:2700], atol=1e-9)


def test_goals_keep_the_limits_while_it_learns_and_when_motions_change():
    def commands(stage, tick, stop):
        if tick in (600, 1000, 1050, 1700):
            stage.deck.switch("jog" if stage.deck.motion == "walk" else "walk")
        stage.deck.blended = 2000 < tick < 2200

    written = np.array(Stage().play(13.0, commands).joints.written)
    for order, name in enumerate(("velocity", "acceleration", "jerk"), 1):
        most = getattr(LIMITS, name) * DT**order
        assert (np.abs(np.diff(written, n=order, axis=0)) <= most * (1.0 + 1e-6)).all()


def narrow(**limits):
    return replace(LIMITS, **{name: np.full(JOINTS, most) for name, most in limits.items()})


def test_it_learns_where_a_motion_asks_for_more_than_the_limits_and_the_picture_does_not_give_in():
    limits = narrow(velocity=2.0)
    learned, plain = (Stage(learns=learns, limits=limits).play(8.4) for learns in (True, False))
    assert (learned.errors(2)[:2] < 0.75 * plain.errors(2)[:2]).all()
    assert np.allclose(np.array(learned.shown)[:1600], np.array(plain.shown)[:1600], atol=1e-9)
    assert min(learned.report.changed[:2]) >= min(plain.report.changed[:2]) > 0
    speeds = np.diff(np.array(learned.joints.written), axis=0) / DT
    assert np.abs(speeds).max() < 2.0 * (1.0 + 1e-6)


def test_a_joint_that_sags_at_the_end_of_its_range_winds_up_nothing():
    stage = Stage(limits=narrow(upper=0.2)).play(8.0)
    assert np.abs(stage.correction.tables["walk", 0][:, 2]).max() < 0.06  # it sags by 0.05


def test_goals_stay_near_a_picture_that_is_always_at_its_limits():
    limits = narrow(velocity=4.7, acceleration=160.0, jerk=12000.0)
    time, rng = np.arange(800) * DT, np.random.default_rng(0)
    targets = (0.8 * np.sin(2.0 * np.pi * np.array([[2.2, 2.6, 3.1]]).T * time)).T
    places = iter(LoopPlace(at, "walk", at / ROUND % 1.0, ROUND, True, 1.0, True) for at in time)
    tables = {("walk", 0): rng.uniform(-0.005, 0.005, (40, JOINTS))}
    correction = Correction(lambda: next(places), np.zeros(JOINTS), 0.0, limits, DT, tables)
    envelope, off = SafetyEnvelope(limits, DT), []
    for row in targets:
        correction.update()
        correction.follow(row, envelope)
        off.append(np.abs(correction.added()).max())
    assert max(off) < 0.04


def copied(tables):
    return {key: table.copy() for key, table in tables.items()}


def disturbed(learned, disturb):
    """The tables before and after a run that begins with what was learned and is disturbed from 4 s to 7 s."""
    stage = Stage(copied(learned.correction.tables))
    before = copied(stage.correction.tables)

    def commands(stage, tick, stop):
        disturb(stage, 4.0 <= tick * DT < 7.0, tick, stop)

    stage.play(8.5, commands)
    key = ("walk", 0)
    return before[key], stage.correction.tables[key], stage


@pytest.mark.parametrize("joint", [0, 2])  # the second one is never far off
def test_a_jammed_joint_winds_up_nothing_and_the_others_learn_on(learned, joint):
    def jam(stage, now, tick, stop):
        stage.joints.jammed[joint] = now

    before, after, stage = disturbed(learned, jam)
    assert np.abs(after[:, joint] - before[:, joint]).max() < 1e-3
    assert (stage.errors(1) < 0.01).all()


@pytest.mark.parametrize("play", [0.002, 0.01])
def test_a_joint_in_a_hand_winds_up_nothing(learned, play):
    def hold(stage, now, tick, stop):
        joints = stage.joints
        if not now:
            stage.where = joints.at[2]
        joints.at[2] = min(max(joints.at[2], stage.where - play), stage.where + play)

    before, after, _ = disturbed(learned, hold)
    assert np.abs(after[:, 2] - before[:, 2]).max() < 1e-3


def test_a_joint_that_is_far_off_learns_nothing_though_it_moves(learned):
    def push(stage, now, tick, stop):
        stage.joints.at[0] += 0.25 * now * DT / LAG  # a quarter of a radian beside its path

    before, after, _ = disturbed(learned, push)
    assert np.abs(after[:, 0] - before[:, 0]).max() < 3e-3


def test_a_joint_that_is_not_free_learns_nothing(learned):
    def take_away(stage, now, tick, stop):
        stage.joints.free[1] = False
        if tick == 0:  # later ones would hide what is learned
            stage.correction.tables["walk", 0][:, 1] = 0.03

    _, after, _ = disturbed(learned, take_away)
    assert np.array_equal(after[:, 1], np.full(len(after), 0.03))


def test_an_emergency_stop_teaches_nothing_and_takes_the_correction_back(learned):
    seen = {}

    def stop_it(stage, now, tick, stop):
        if tick == 800:
            stop.state.press("command")
        if tick == 900:
            seen["before"] = copied(stage.correction.tables)["walk", 0]
            seen["added"] = stage.correction._added.copy()
        if tick == 1400:
            seen["after"] = copied(stage.correction.tables)["walk", 0]

    disturbed(learned, stop_it)
    assert np.array_equal(seen["before"], seen["after"])
    assert not seen["added"].any()


def test_it_is_never_larger_than_its_bound():
    class Sagging(Shafts):
        def write(self, targets, pose):
            super().write(targets, pose)
            self.at[1] -= 0.19 * DT / LAG  # too far for it, and not so far that the joint counts as held

    stage = Stage()
    stage.joints.__class__ = Sagging
    stage.play(20.0)
    table = stage.correction.tables["walk", 0]
    assert np.abs(table).max() == pytest.approx(LARGEST)


def test_tempos_that_differ_are_learned_apart():
    def commands(stage, tick, stop):
        stage.deck.tempo = 1.6 if tick > 400 else 1.1

    stage = Stage().play(4.0, commands)
    assert [*stage.correction.tables] == [("walk", 0), ("walk", 2)]


def test_what_is_learned_lies_at_the_phase_that_the_picture_has_when_a_shaft_is_off():
    class Pulled(Shafts):
        def write(self, targets, pose):
            super().write(targets, pose)
            shown = (stage.deck.phase - LAG / ROUND) % 1.0
            self._measured[-1][1] -= 0.02 if 0.4 < shown < 0.5 else 0.0

    stage = Stage()
    stage.joints.__class__ = Pulled
    stage.play(3.6)
    table = stage.correction.tables["walk", 0][:, 1]
    plain = Stage().play(3.6).correction.tables["walk", 0][:, 1]
    pull = table - plain
    centre = (np.arange(len(pull)) / len(pull)) @ pull / pull.sum()
    assert centre == pytest.approx(0.45, abs=0.012)


@pytest.mark.parametrize("what", ["switch", "blend", "jump", "stop"])
def test_corrections_fade(learned, what):
    stage, added = Stage({("walk", 0): np.full((40, JOINTS), 0.1), ("jog", 0): np.full((40, JOINTS), -0.1)}), []
    for table in stage.correction.tables.values():
        table[::2] -= 0.02
    stage.joints.free[:] = False  # nothing is learned meanwhile
    stage.deck.__class__ = Still  # goals move by the correction alone

    def commands(stage, tick, stop):
        added.append(stage.correction._added.copy())
        if tick == 300:
            if what == "switch":
                stage.deck.switch("jog")
            elif what == "jump":
                stage.deck.phase = (stage.deck.phase + 0.5) % 1.0
            elif what == "stop":
                stop.state.press("command")
        stage.deck.blended = what == "blend" and tick >= 300

    stage.play(2.5, commands)
    steps = np.abs(np.diff(added, axis=0))
    assert steps.max() < 0.2 * 2.0 * DT / 0.3
    last = {"switch": -0.1, "blend": 0.0, "jump": 0.09, "stop": 0.0}[what]
    assert added[-1] == pytest.approx(np.full(JOINTS, last), abs=0.03)
