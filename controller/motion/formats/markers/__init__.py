"""Recordings of markers: their files, and the body that wore them."""
