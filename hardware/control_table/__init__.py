"""Control tables and facts of servo models, as data."""
