"""Acclaim: skeletons (.asf) and their recordings (.amc)."""
