"""The library file: header and networks."""
