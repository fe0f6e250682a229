"""Plots, pictures and films of what the commands report."""
