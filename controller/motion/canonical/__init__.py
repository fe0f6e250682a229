"""One body for all recordings: carried to it, cut, resampled and mirrored on it, and what is doubtful about it."""
