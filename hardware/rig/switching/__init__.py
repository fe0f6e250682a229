"""Switching a rig on and off: identities, settings, and torque only where a joint stands."""
