"""`motiondeck rig`: the tools of a servo rig."""
