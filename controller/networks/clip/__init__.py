"""Recorded motions as the keys of splines."""
