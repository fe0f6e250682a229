"""Pictures and films, drawn off screen."""
