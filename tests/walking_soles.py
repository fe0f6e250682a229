"""Soles of somebody who walks, stands or steps on the spot, made up."""

import numpy as np

from sim.physics.walking.preview import Footfalls


def walking_soles(seconds, dt, length=0.3, step=0.5, lift=0.05, begins=1.0, turn=0.0):
    """Soles of somebody who begins to walk: (T, 2, 3), m; their yaws (T, 2) and the heading (T,), rad.

    A step takes `step` seconds, goes 2 `length` far and turns by `turn`; foot 0, on the left, goes first.
    """
    soles, yaws, headings = [], [], []
    feet, angles = np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]]), np.zeros(2)
    for k in range(round(seconds / dt)):
        count, share = divmod(max(k * dt - begins, 0.0) / step, 1.0)
        number = int(count)
        now, angle = feet.copy(), angles.copy()
        for n in range(number + 1):
            foot, done = n % 2, 1.0 if n < number else share
            done = done * done * (3.0 - 2.0 * done)
            now[foot, 0] += done * (length if n == 0 else 2.0 * length)
            angle[foot] += done * (turn if n == 0 else 2.0 * turn)
        if k * dt > begins:
            now[number % 2, 2] = lift * np.sin(np.pi * share) ** 2
        soles.append(now)
        yaws.append(angle)
        headings.append(angle.mean())
    return np.array(soles), np.array(yaws), np.array(headings)


def go_after(gait, soles, dt, preview):
    """Lets a gait go after soles ahead of it: each tick from 0 on, the time, s, and the swing that has ended."""
    footfalls = Footfalls(1.0, dt)
    for k, row in enumerate(zip(*soles, strict=True)):
        footfalls.add(k * dt, *row)
        now = (k + 1) * dt - preview
        if now < 0.0:
            continue
        ended = gait.advance(now, footfalls.swings, preview)
        if ended is not None:
            footfalls.forget(ended)
        yield now, ended
