"""Emulated servos: memory, rules, motors, and the answers of older ones."""
