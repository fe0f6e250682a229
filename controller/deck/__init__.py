"""The deck: what is played when, and how one motion is joined to the next."""
