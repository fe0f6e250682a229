"""Measures networks and libraries: accuracy, failure rates, transitions."""
