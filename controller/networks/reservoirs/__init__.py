"""Reservoir networks: conceptors of several kinds, echo-state networks, morphing."""
