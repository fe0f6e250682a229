"""Random feature conceptors."""
