"""From clips to a motion library: closing loops, ridge regression, self-test, and the library file."""
