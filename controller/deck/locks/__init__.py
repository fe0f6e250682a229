"""What the phase of a motion can be locked to: a beat, another deck, the measured body."""
