"""The page of a run: what it shows, and what can be learned on it."""
