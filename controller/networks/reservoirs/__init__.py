"""Shared by several kinds of networks: reservoirs, conceptor algebra, phase."""
