"""Segmentation of recordings into behaviours, and its scores."""
