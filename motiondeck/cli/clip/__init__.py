"""`motiondeck clip`: recordings, looked at, converted and filled."""
