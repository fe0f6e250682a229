"""Figures of joint motions for microcontrollers: what `motiondeck export` writes, and the C that plays it."""
