"""Driving servos: goals out and states in each tick, in as few packets as possible."""
