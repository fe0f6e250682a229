"""The state that a page reads."""

import subprocess
import sys


def test_it_is_read_without_the_control_tables_of_servos():
    """They take a run and its page 30 ms to load, which most runs do not need."""
    program = "import sys, motiondeck.page.web.page_state; print([name for name in sys.modules if 'families' in name])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
