"""Shared by all packages: errors, files, TOML, parallel jobs."""
