"""Echo-state networks with output feedback."""
