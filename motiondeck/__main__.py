# pyright: strict
"""python -m motiondeck: the command line."""

from motiondeck.command import main

main()
