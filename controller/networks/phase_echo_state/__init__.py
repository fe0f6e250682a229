"""Echo-state networks that a phase drives."""
