"""Falls: how a robot protects itself in one."""
