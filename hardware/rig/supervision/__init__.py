"""A rig supervised while it moves: health, strain, restarts, and several ports as one rig."""
