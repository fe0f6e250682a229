"""What stands where in a servo's memory, as data."""
