"""What is said to a deck and what it answers: commands, replies and events; typed, and JSON on the wire."""
