"""Feetech STS servos: frames like those of Dynamixel Protocol 1.0, with a sync read, and a table of their own."""
