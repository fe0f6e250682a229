"""What is decided about a recording before it is learned, each step with its evidence."""
