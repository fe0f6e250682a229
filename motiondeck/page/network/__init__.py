"""A look inside the network that plays: orbits of its neurons, how its motions overlap, the phases of its centers."""
