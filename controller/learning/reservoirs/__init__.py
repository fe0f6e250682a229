"""Conceptors: loading of reservoirs, and choice of apertures and ranks; completion of bodies."""
