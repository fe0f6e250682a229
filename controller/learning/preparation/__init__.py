"""Preparation of clips for training: cycles, closed loops, joined takes."""
