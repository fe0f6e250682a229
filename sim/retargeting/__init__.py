"""Poses of a human carried onto the joints of a robot."""
