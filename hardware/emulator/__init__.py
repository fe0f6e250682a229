"""Emulated servo rigs: the same bytes as real servos, without the hardware."""
