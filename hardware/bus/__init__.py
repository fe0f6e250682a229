"""The servo bus: a port, and packets with deadlines."""
