"""One motion as it plays: a network in continuous time, alone or mixed with another."""
