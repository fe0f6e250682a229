"""The training of each kind of network: one file a kind, found by its name."""
