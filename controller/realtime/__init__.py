"""The deck: one real-time loop that turns commands into joint targets at a steady rate."""
