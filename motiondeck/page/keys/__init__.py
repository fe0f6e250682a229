"""Writing keyframes of a rig on a page: its keys, the preview through its limits, and learning and playing it."""
