"""`motiondeck recognize` and `motiondeck segment`."""
