"""How fast what falls gets faster, in every model that is made here."""

GRAVITY = 9.81
"""m/s^2, MuJoCo's default."""
