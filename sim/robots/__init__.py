"""A robot as the deck uses it, its calibration, and the fidelity of its motions."""
