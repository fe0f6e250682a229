"""A sensor decides what is played: the nearer somebody comes, the livelier the robot moves.

The robot is simulated, its servos are emulated with every byte of their protocol. With servos on the desk, name the rig
file instead of "emulated". The sensor is made up; read yours in `distance`.

python examples/switch_by_sensor.py --seconds 20
"""

import argparse
import math
import time

import motiondeck

NEAR, FAR = 1.0, 2.0  # m


def distance(seconds: float) -> float:
    """How far away somebody is, m: here a person who comes and goes twice in 10 s."""
    return 1.5 + math.cos(2.0 * math.pi * seconds / 5.0)


def motion_for(metres: float, present: str) -> str:
    """What to play; between NEAR and FAR the present motion goes on, so that noise does not switch to and fro."""
    if metres < NEAR:
        return "jog"
    return "walk" if metres > FAR else present


def main() -> None:
    """Plays for some time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rig", default="emulated", help="a rig file, or 'emulated'")
    options = parser.parse_args()

    with motiondeck.play("thesis15", "walk", robot="servo20", rig=options.rig, physics=False) as deck:
        start, present = time.monotonic(), "walk"
        while (now := time.monotonic() - start) < options.seconds:
            wanted = motion_for(distance(now), present)
            if wanted != present:
                print(f"{now:5.1f} s: {distance(now):.2f} m away, so {wanted}")
                deck.switch(wanted)
                present = wanted
            time.sleep(0.05)
    report = deck.wait()
    print(f"{len(report['switches'])} switches, rig followed within {report['rig']['tracking_rmse_rad']:.3f} rad (rms)")


if __name__ == "__main__":
    main()
