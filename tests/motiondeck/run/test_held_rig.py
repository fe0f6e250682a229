"""A walking rig of emulated servos is held by its knees: it waits, overloads nothing, and goes on from there."""

import msgspec
import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from controller.deck.deck import Deck
from controller.deck.locks.phase_lock import wrapped
from controller.loop.safety.safety_envelope import SafetyEnvelope
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import load_rig
from hardware.rig.supervision.rig import Rig
from motiondeck.run.robots.rig_output import RigOutput, narrowed
from motiondeck_base.shipped import find_rig, find_robot
from shipped_libraries import shipped
from sim.robots.robot import load_robot

DT = 0.01
KNEES = "r_knee", "l_knee"


class WalkingRig:
    """A deck that walks on servo20's hips and knees, locked to them."""

    def __init__(self):
        library = shipped()
        robot = load_robot(find_robot("servo20"), library.skeleton)
        whole = load_rig(find_rig("servo20"))
        legs = tuple(joint for joint in whole.joints if joint.name in (*KNEES, "r_hip_pitch", "l_hip_pitch"))
        self.config = msgspec.structs.replace(whole, joints=legs)
        self.port = EmulatedPort(EmulatedBus(self.config), paced=True)
        rig = Rig(self.config, lambda part: Bus(self.port, part.baud), beside=False, sleep=self.port.elapse)
        self.output = RigOutput(rig, robot.joints, 1.0 / DT)
        limits = narrowed(robot.limits, robot, self.config)
        self.envelope = SafetyEnvelope(limits, DT)
        self.deck = Deck(library, robot.retarget, "walk")
        self.deck.measured = self.output.measured
        start = np.clip(self.deck.update(DT)[0], limits.lower, limits.upper)
        self.envelope.start(start)
        for _ in range(80):
            self._tick(start)
        self.deck.lock("body")

    def play(self, seconds):
        """Time after time the phase and the tempo."""
        rows = []
        for _ in range(round(seconds / DT)):
            self._tick(self.deck.update(DT)[0])
            rows.append((self.deck.phase, self.deck.tempo))
        return np.array(rows)

    def hold(self, held):
        """Blocks the knees' horns, or lets them go."""
        for device in self.knees:
            device.bank.drive.jammed[device.row] = held

    @property
    def knees(self):
        return [self.port.bus[joint.id] for joint in self.config.joints if joint.name in KNEES]

    def _tick(self, targets):
        self.output.write(self.envelope(targets), self.deck.pose)
        self.port.elapse(DT)


@pytest.mark.thorough
def test_held_by_the_knees_it_waits_without_overload_and_goes_on_from_there():
    walker = WalkingRig()
    free = walker.play(1.6)
    assert free[-30:, 1].mean() > 0.9
    walker.hold(True)
    # A servo that pushes with all its strength for a second would be overloaded and switch its torque off.
    held = walker.play(2.0)
    assert np.abs(held[-60:, 1]).max() < 0.02
    assert walker.deck.lock_state.state == "waiting"
    assert abs(wrapped(held[-1, 0] - free[-1, 0])) < 0.2
    assert [knee["hardware_error_status"] for knee in walker.knees] == [0, 0]
    walker.hold(False)
    after = walker.play(1.2)
    assert (after[-20:, 1] > 0.8).all()
    assert walker.deck.lock_state.state == "locked"
    assert abs(wrapped(after[0, 0] - held[-1, 0])) < 0.02
    assert wrapped(after[-1, 0] - held[-1, 0]) != pytest.approx(0.0, abs=0.1)
    passed = [abs(wrapped(step)) for step in np.diff(np.concatenate([free, held, after])[:, 0]).tolist()]
    assert max(passed) < 1.3 * DT / walker.deck.performance.motion.seconds  # nowhere does it jump
