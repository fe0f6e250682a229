"""From one motion to the next without a jump: fades, blends, and what is too fast."""
