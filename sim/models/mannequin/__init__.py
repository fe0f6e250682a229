"""The mannequin: a robot built from any skeleton."""
