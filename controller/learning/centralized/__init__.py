"""Training of centralized networks: frequencies, satellites, weights, and their numbers."""
