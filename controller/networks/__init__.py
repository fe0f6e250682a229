"""The networks, one file each; they need neither a clock nor a trainer."""
