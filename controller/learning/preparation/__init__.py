"""Clips made ready for a trainer: loops closed, channels as a network sees them."""
