"""A conceptor network whose motions share all weights."""
