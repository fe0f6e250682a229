"""Cutting a recording into its behaviours, and scoring the cuts."""
