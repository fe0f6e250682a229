"""The policies of a moving rig: health, pace, recovery."""
