"""Curves of a run over time: joints, servos, loop, bus and neurons, as each browser chooses them."""
