"""Driving a rig of Dynamixel servos: goals out and states in, each tick, by as few packets as can be."""
