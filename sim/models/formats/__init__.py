"""Model files of other tools: parts of URDFs and meshes that MuJoCo does not read."""
