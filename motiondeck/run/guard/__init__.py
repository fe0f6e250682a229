"""The guard: a process between deck and bus that owns the rig, its envelope, its writes and its emergency stop."""
