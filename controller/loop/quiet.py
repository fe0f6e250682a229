"""Quiet: no garbage collector and no second BLAS thread while the loop runs."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def undisturbed() -> Iterator[None]:
    """Keeps the garbage collector off and BLAS at one thread inside; both are restored afterwards.

    What exists is frozen, so that no collection looks at it. Two BLAS threads would wait for one another and cost the
    loop milliseconds at p99.
    """
    collecting = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        with threadpool_limits(1):
            yield
    finally:
        gc.unfreeze()
        if collecting:
            gc.enable()
