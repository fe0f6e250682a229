"""What the page draws about the simulated body: its target pose, forces, steps; and the mouse that pushes it."""
