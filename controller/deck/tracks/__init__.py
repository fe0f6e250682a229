"""Motions as they play: networks in continuous time, alone or blended."""
