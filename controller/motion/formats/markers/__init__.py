"""Recordings of markers: their formats, and the body fitted to them."""
