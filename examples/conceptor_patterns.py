"""Jaeger's periodic patterns in one reservoir: recalled by their conceptors, morphed, combined and plotted.

Four patterns, two sines of irrational periods and two random ones of period 5, are loaded into 100 neurons (Jaeger
2014, section 3.2). A conceptor picks one of them; a mixture of two conceptors plays what lies between.

python examples/conceptor_patterns.py --plot patterns.png        (needs: pip install "motiondeck[plot]")
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motiondeck import networks

FRAMES = 1500


def patterns() -> dict[str, NDArray[np.float64]]:
    """The signals by their names, shape (FRAMES, 1) each."""
    n = np.arange(FRAMES)
    rng = np.random.default_rng(3)
    first = scaled(rng.uniform(-1.0, 1.0, 5))
    second = scaled(first + rng.uniform(-0.2, 0.2, 5))  # a little different from the first
    signals = {
        "sine 8.83": np.sin(2.0 * np.pi * n / 8.8342522),
        "sine 9.83": np.sin(2.0 * np.pi * n / 9.8342522),
        "random 5": first[n % 5],
        "nearly the same": second[n % 5],
    }
    return {name: signal[:, None] for name, signal in signals.items()}


def scaled(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same brought to [-1, 1]."""
    return 2.0 * (points - points.min()) / np.ptp(points) - 1.0


def main() -> None:
    """Loads, recalls, computes with conceptors, morphs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--aperture", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=2, help="of the random reservoir")
    parser.add_argument("--plot", type=Path, metavar="FILE")
    options = parser.parse_args()

    signals = patterns()
    # Not every random reservoir holds all four for ever: of the seeds 0 to 5, 1 and 2 do.
    loaded = networks.load_signals(signals, seed=options.seed)
    conceptors = {name: loaded.conceptor(name, options.aperture) for name in signals}

    for name, c in conceptors.items():
        # There may be other attractors beside the pattern, so the run begins in one of its own states.
        played = loaded.run(c, 300, start=loaded.states[name][0])[100:]
        # Its phase drifts freely, so the best of many shifts counts.
        error = min(networks.nrmse(played, signals[name][start : start + 200]) for start in range(100, 300))
        print(f"{name:>15}: recalled with nrmse {error:.3f}, uses {networks.quota(c):.0%} of the reservoir")

    first, second = conceptors["sine 8.83"], conceptors["sine 9.83"]
    other = conceptors["random 5"]
    print(f"similarity of the two sines {networks.similarity(first, second):.2f}, ", end="")
    print(f"of a sine and a random pattern {networks.similarity(first, other):.2f}")
    print(f"sine OR random uses {networks.quota(networks.disjunction(first, other)):.0%}, ", end="")
    print(f"sine AND random {networks.quota(networks.conjunction(first, other)):.0%}, ", end="")
    print(f"NOT sine {networks.quota(networks.negation(first)):.0%}")

    # From the first sine beyond the second one: the period grows on the way.
    shares = np.concatenate([np.zeros(50), np.linspace(0.0, 1.5, 200), np.full(50, 1.5)])
    morphed = loaded.morph(first, second, shares)

    if options.plot is not None:
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(len(signals) + 1, 1, figsize=(8, 8), layout="constrained")
        for axis, (name, c) in zip(axes, conceptors.items(), strict=False):
            axis.plot(loaded.run(c, 40, start=loaded.states[name][0]))
            axis.set_title(name)
        axes[-1].plot(morphed)
        axes[-1].set_title("morphed from one sine to beyond the other")
        figure.savefig(options.plot)
        print(f"wrote {options.plot}")


if __name__ == "__main__":
    main()
