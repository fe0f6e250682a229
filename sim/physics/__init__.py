"""Simulated servos and masses: playback, balance, walking, loads, preflight."""
