"""Measures of a network: accuracy, disturbance, intervals, the self-test."""
