"""Recordings: one file a format, and one way in (`reading`) and out (`writing`)."""
