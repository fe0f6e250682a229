"""What a run drives: a robot with its simulation and its rig, or a rig alone."""
