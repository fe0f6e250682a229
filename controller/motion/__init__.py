"""Motion capture: skeletons, clips, one reader per file format, and the encodings that networks learn."""
