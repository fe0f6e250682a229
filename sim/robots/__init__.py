"""A robot as the deck uses it, its calibration, and how well it does what the human did."""
