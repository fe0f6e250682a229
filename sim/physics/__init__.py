"""Simulated servos and masses: playback, balance, loads, preflight."""
