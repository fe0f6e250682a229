"""Centralized networks: centers, satellites, the switching module."""
