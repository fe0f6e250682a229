"""The user's folder for what is kept from run to run."""

import os
from pathlib import Path


def state_folder() -> Path:
    """`motiondeck` in XDG_STATE_HOME (else ~/.local/state); it need not exist."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "motiondeck"
