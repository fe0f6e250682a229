"""Encodings: what the channels of a network mean, and how a clip becomes channels and back."""
