"""Servo rigs: the Dynamixel bus, control tables, rig files and an emulator; this package knows no motion."""
