"""Gravity of all models."""

GRAVITY = 9.81  # m/s^2, MuJoCo's default
