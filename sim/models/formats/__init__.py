"""Model files as other tools write them: what MuJoCo does not read of a URDF and its meshes."""
