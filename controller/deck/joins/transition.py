"""Switching motions without a jump: the new motion starts at once, and the difference to the old one fades away.

At the switch the target motion is started where it resembles the present body most (`entry_costs`), and for each bone
the rotation that leads from the target to what was shown is kept as a rotation vector, with its rate of change. From
then on the target is shown turned by that vector while it runs out along a quintic that starts with the same value and
slope and ends with neither (inertialisation, Bollo 2018). What slope it starts with may run out sooner than the
difference in place, where a body would swing too far otherwise. Since bones are turned and never mixed, they keep their
length. How long that takes is found by `fade_search`.

The vectors stay fixed in the world. The heading would be no frame for them: it is that of the hips, and flies round
while a body stands on its hands.

Where bone directions alone are known, how a bone twists about itself follows a rule (`motion.orientation`), often
faster than the bone moves. A rate that held this twist would turn the bone with it once the bone points elsewhere, so
it runs out beside the vector, about the bone itself.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from controller.motion import rotations as rot
from controller.motion.quintic import run_out, run_out_rates
from controller.motion.rotations import Array
from controller.motion.skeleton import Posture


@dataclass(frozen=True)
class Fade:
    """A difference that runs out.

    It has a row for the turn of the root and of each bone, rad, one for the drift of height, m, and velocity, m/s, and,
    where twists follow a rule, one for the twist of each bone about itself in the rest pose, rad. Turns and drift are
    seen from the heading at the switch.
    """

    duration: float  # how long it takes, s
    slowing: float  # how long until nothing is left of its rate, s, at most the duration
    value: Array  # of the difference when it begins, shape (rows, 3)
    rate: Array  # the same a second

    def left(self, elapsed: float) -> Array:
        """What is left of the difference after some seconds, shape (rows, 3)."""
        value, slope = self.shares(np.array(elapsed))
        return value * self.value + slope * self.rate

    def leaving(self, elapsed: float) -> Array:
        """How fast that changes then, shape (rows, 3), a second."""
        value, _ = run_out_rates(min(elapsed / self.duration, 1.0))
        _, slope = run_out_rates(min(elapsed / self.slowing, 1.0))
        return value / self.duration * self.value + slope * self.rate

    def shares(self, elapsed: Array) -> tuple[Array, Array]:
        """What is left of the value after some seconds, and of the way on which its rate leads until then, s."""
        value, _ = run_out(np.minimum(elapsed / self.duration, 1.0))
        _, slope = run_out(np.minimum(elapsed / self.slowing, 1.0))
        return value, self.slowing * slope


def difference(
    shown: tuple[Posture, Posture], target: tuple[Posture, Posture], dt: float, rest_direction: Array | None = None
) -> tuple[Array, Array]:
    """What leads from a target to what is shown, and its rate: value and rate of a fade, shape (rows, 3).

    Each is given by its postures dt seconds ago and now; rest directions (B, 3) are for twists that follow a rule.
    """
    now = _side_by_side(shown[1], target[1])
    before = _from_now(_side_by_side(shown[0], target[0]), now, dt)
    twists: list[Array] = []
    if rest_direction is not None:
        before, twist = _untwisted(before, now, rest_direction)
        twists.append((twist[0] - twist[1]) / dt)
    rotation = np.stack([before.rotation, now.rotation], axis=1)  # of what is shown, and of the target
    earlier, turn = _turn(rotation[0], rotation[1])
    turn_rate = (turn - rot.nearest_rotation_vector(earlier, turn)) / dt
    drift = _drift(now)
    drift_rate = (drift - _drift(before)) / dt
    value = np.concatenate([turn, drift[:1] - drift[1:], *map(np.zeros_like, twists)])
    return value, np.concatenate([turn_rate, drift_rate[:1] - drift_rate[1:], *twists])


def displaced(target: Posture, left: Array, turned: float) -> Posture:
    """A target with what is left of a difference, shape (rows, 3), its heading turned by some rad since the switch."""
    back, parts = rot.yaw(-turned), len(target.rotation)
    rotation = rot.multiply(rot.from_rotation_vector(rot.rotate(back, left[:parts])), target.rotation)
    if len(left) > parts + 1:
        rotation[1:] = rot.multiply(rotation[1:], rot.from_rotation_vector(left[parts + 1 :]))
    height, *drift = left[parts]
    velocity = target.velocity + rot.rotate(back, np.array([*drift, 0.0]))[:2]
    return replace(target, height=target.height + height, velocity=velocity, rotation=rotation)


def extrapolated(before: Posture, now: Posture, dt: float, rest_direction: Array | None = None) -> Posture:
    """The posture dt seconds after two others, if every bone turns and the root moves on as they did.

    With rest directions, as for `difference`, bones twist no further.
    """
    earlier = _from_now(before, now, dt)
    if rest_direction is not None:
        earlier, _ = _untwisted(earlier, now, rest_direction)
    step = _turn(now.rotation, earlier.rotation)
    turned = float(now.turn_rate) * dt
    back = rot.yaw(-turned)
    velocity = rot.rotate(back, np.append(now.velocity, 0.0))[:2]
    rotation = rot.multiply(back, rot.multiply(rot.from_rotation_vector(step), now.rotation))
    return replace(now, height=2.0 * now.height - before.height, velocity=velocity, rotation=rotation)


def entry_costs(place: Array, velocity: Array, places: Array, velocities: Array, reach: float) -> Array:
    """How little each anchor of a motion resembles a body, shape (A,), m^2.

    From joint positions in the heading frame and their rates, shape (F,), m and m/s, and the same at the anchors, (A,
    F); a difference in velocity counts by `reach`, s.
    """
    return np.square(places - place).sum(1) + reach**2 * np.square(velocities - velocity).sum(1)


def _side_by_side(first: Posture, second: Posture) -> Posture:
    return Posture(*(np.array([getattr(one, field.name) for one in (first, second)]) for field in fields(Posture)))


def _from_now(before: Posture, now: Posture, dt: float) -> Posture:
    """Postures (...) dt seconds ago, seen from the present headings."""
    turned = dt * now.turn_rate
    cosine, sine = np.cos(turned), np.sin(turned)
    forward, left = before.velocity[..., 0], before.velocity[..., 1]
    velocity = np.stack([cosine * forward + sine * left, cosine * left - sine * forward], axis=-1)
    return replace(before, velocity=velocity, rotation=rot.multiply(rot.yaw(-turned)[..., None, :], before.rotation))


def _untwisted(before: Posture, now: Posture, rest_direction: Array) -> tuple[Posture, Array]:
    """Postures (...) whose bones lead to the present ones the shortest way, and by how much they twist on that way.

    The twists are rotation vectors about the bones in the rest pose, shape (..., B, 3), rad.
    """
    bones, present = before.rotation[..., 1:, :], now.rotation[..., 1:, :]
    was, here = rot.rotate(np.stack([bones, present]), rest_direction)
    untwisted = rot.multiply(rot.between(here, was), present)
    twist = rot.to_rotation_vector(rot.multiply(rot.conjugate(bones), untwisted))
    return replace(before, rotation=np.concatenate([before.rotation[..., :1, :], untwisted], axis=-2)), twist


def _turn(shown: Array, target: Array) -> Array:
    return rot.to_rotation_vector(rot.multiply(shown, rot.conjugate(target)))


def _drift(posture: Posture) -> Array:
    return np.concatenate([np.asarray(posture.height)[..., None], posture.velocity], axis=-1)
