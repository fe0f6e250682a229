"""Rehearsal: joint targets with which a robot does a motion on a free root, found in many short simulations."""
