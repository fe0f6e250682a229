"""Acclaim: skeletons (.asf) and the recordings that belong to them (.amc)."""
