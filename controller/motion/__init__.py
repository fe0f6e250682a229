"""Motion capture: skeletons, clips, a reader for each file format, and the encodings that networks learn."""
