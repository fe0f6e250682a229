"""Switch a live rig by a sensor: the nearer a person comes, the livelier the robot moves.

The servos are emulated, with every byte of their protocol. For real ones name a rig file in place of "emulated".

python examples/switch_by_sensor.py
"""

import math
import time

import motiondeck


def distance() -> float:
    """The distance of a person, m: read your sensor here. This one comes and goes every 2.5 s."""
    return 1.5 + math.cos(2.0 * math.pi * time.monotonic() / 2.5)


with motiondeck.play("thesis15", "walk", robot="servo20", rig="emulated", physics=False) as deck:
    for _ in range(100):
        metres, present = distance(), deck.status().motion
        wanted = "jog" if metres < 1.0 else "walk" if metres > 2.0 else present  # noise does not switch to and fro
        if wanted != present:
            print(f"{metres:.2f} m away, so {wanted}, in {deck.switch(wanted).wait():.2f} s")
        time.sleep(0.03)
print(f"{len(deck.wait()['switches'])} switches")
