"""Dynamixel Protocol 1.0 as pure functions on bytes: AX, RX and MX servos."""
