"""Dynamixel Protocol 2.0 as pure functions on bytes."""
