"""The options of a run, and what they name: library, first motion, timeline."""
