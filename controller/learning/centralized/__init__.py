"""Trainers of centralized networks: frequencies, satellites, weights, and how many are worth it."""
