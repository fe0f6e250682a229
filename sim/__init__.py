"""MuJoCo: robots built or loaded, poses carried onto them, played back with or without physics, and shown."""
