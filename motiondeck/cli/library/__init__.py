"""`motiondeck library`: what a motion library holds."""
