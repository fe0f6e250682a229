"""Lines that come whole where several processes print to one terminal or file."""

import io
import os
import sys


def print_whole_lines() -> None:
    """Makes this process, and those that it starts from now on, write each line at once, its end included.

    Where PYTHONUNBUFFERED is set, Python writes the end of a line by itself, and another process may come between.
    """
    os.environ.pop("PYTHONUNBUFFERED", None)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.write_through:
            stream.reconfigure(line_buffering=True, write_through=False)
