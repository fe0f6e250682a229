"""Tools for a rig at rest: doctor, calibration, teaching, monitor."""
