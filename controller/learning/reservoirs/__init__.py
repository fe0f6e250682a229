"""Trainers of reservoir networks: conceptors, random feature conceptors, echo-state networks."""
