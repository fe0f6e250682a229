"""The library file, and what the motions in it are good for."""
