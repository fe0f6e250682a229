"""Read and move the joints of a rig.

By default the servos are emulated: real protocol bytes over a pseudo-terminal, in real time. "simulated" ones need no
waiting; "real" ones are on the port that the rig file names.

python examples/drive_rig.py --servos simulated
"""

import argparse

import numpy as np

import motiondeck


def main() -> None:
    """Nods with one joint, and prints how far the servo was behind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rig", default="servo20", help="a shipped rig, or a rig file")
    parser.add_argument("--servos", default="emulated", choices=["real", "emulated", "simulated"])
    parser.add_argument("--joint", default="", help="the first one by default")
    parser.add_argument("--nods", type=int, default=2)
    options = parser.parse_args()

    with motiondeck.open_rig(options.rig, options.servos) as rig:
        joint = options.joint or rig.joints[0]
        index = rig.joints.index(joint)
        print(f"{len(rig.joints)} joints; {joint} is at {rig.read()[index]:.3f} rad")
        rig.move_to(np.zeros(len(rig.joints)), seconds=1.0)
        low, high = max(-0.3, rig.lower[index]), min(0.3, rig.upper[index])
        worst = 0.0
        for step in range(options.nods * 50):
            target = 0.5 * (low + high) + 0.5 * (high - low) * np.sin(2 * np.pi * step / 50)
            rig.write({joint: target})
            rig.wait(0.02)
            worst = max(worst, abs(target - rig.read()[index]))
        rig.move_to({joint: 0.0}, seconds=0.5)
        print(f"nodded {options.nods} times, at most {worst:.3f} rad behind")


if __name__ == "__main__":
    main()
