"""The real-time loop: clock, safety envelope, outputs, and the phases of a run."""
