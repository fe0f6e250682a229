"""A rig: its file, its units, switching it on and off, and driving it."""
