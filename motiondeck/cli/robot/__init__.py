"""`motiondeck robot`: robots listed, calibrated and checked."""
