"""The networks that play motions, one file each; they need neither a clock nor a trainer."""
