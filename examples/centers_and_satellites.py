"""A time series from oscillators: centers turn, satellites respond, their weighted sum is the signal.

The same signal is learned over harmonic, Duffing and pendulum centers (Vakulenko et al. 2017), then played with another
tempo, which a nonlinear center takes on when its control parameter changes.

python examples/centers_and_satellites.py
"""

import numpy as np

from motiondeck import networks

RATE = 100.0  # Hz
PERIOD = 1.0  # s
OMEGA = 2.0 * np.pi / PERIOD


def main() -> None:
    """Learns one period over each kind of centers, plays ten."""
    time = np.arange(round(PERIOD * RATE)) / RATE
    angle = OMEGA * time
    signal = np.stack([np.exp(np.sin(angle)), np.sin(2.0 * angle) + 0.3 * np.cos(angle)], axis=1)

    duffing, pendulum = networks.Duffing(1.0, 0.3), networks.Pendulum()
    centers = {
        "harmonic": networks.HarmonicCenters.at_phase(np.array([OMEGA])),
        "Duffing": networks.NonlinearCenters.at_rest(
            duffing, np.array([networks.control_for(duffing, OMEGA, 1.0)]), 1.0
        ),
        "pendulum": networks.NonlinearCenters.at_rest(
            pendulum, np.array([networks.control_for(pendulum, OMEGA, 1.0)]), 1.0
        ),
    }
    satellites = {
        "Gaussian": networks.GaussianSatellites(networks.grid_places(2, 36), np.full(36, 2.5)),
        "polynomial": networks.PolynomialSatellites(networks.lowest_orders(2, 21)),
    }
    for center, oscillator in centers.items():
        for kind, functions in satellites.items():
            network = networks.learn_weights(signal, RATE, oscillator, functions, regulariser=1e-9)
            played = network.run(10 * len(signal), 1.0 / RATE)
            error = networks.nrmse(played, np.tile(signal, (10, 1)))
            print(f"{center:>9} centers, {len(functions)} {kind} satellites: nrmse {error:.4f} over ten periods")

    network = networks.learn_weights(signal, RATE, centers["pendulum"], satellites["polynomial"], regulariser=1e-9)
    pendulum_centers = network.centers
    assert isinstance(pendulum_centers, networks.NonlinearCenters)
    pendulum_centers.set_control(np.array([networks.control_for(pendulum, 1.5 * OMEGA, 1.0)]))
    played = network.run(600, 1.0 / RATE)[200:, 0]
    rounds = np.flatnonzero((played[:-1] < 1.0) & (played[1:] >= 1.0))
    print(f"with the pendulum's control for 1.5 times the tempo a period takes {np.diff(rounds).mean() / RATE:.2f} s")


if __name__ == "__main__":
    main()
