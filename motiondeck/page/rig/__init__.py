"""The servos of a rig on the page: a card each, a plot, what can be done with one, and joints that glow."""
