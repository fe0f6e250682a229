"""An echo-state network on a signal of your own: it learns to predict 10 frames ahead.

python examples/echo_state_signal.py
"""

import numpy as np

from motiondeck import networks

time, ahead, learned = np.arange(3000.0), 10, 2000
signal = (np.sin(time / 5.0) * np.sin(time / 17.0))[:, None]  # yours: an array (frames, channels)
reservoir = networks.random_reservoir(100, 1)
network = networks.learn_response(reservoir, signal[:learned], signal[ahead : learned + ahead])
predicted = network.respond(signal[:-ahead])
error = networks.nrmse(predicted[learned:], signal[learned + ahead :])
print(f"{ahead} frames ahead, on frames that were not learned: nrmse {error:.3f}")
