"""Switching a rig on and off: who is there, how the servos are set, and torque only where a joint stands."""
