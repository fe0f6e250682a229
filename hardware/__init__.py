"""Servo rigs: the servo families, the bus, rig files and an emulator; this package knows no motion."""
