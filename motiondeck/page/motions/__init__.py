"""Choosing motions on the page: a grid with pictures, the queue, blends and the phase."""
