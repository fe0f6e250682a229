"""A rig: its file, its units, its registers; in rooms of their own switching it, driving it, keeping it safe."""
