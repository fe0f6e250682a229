"""No garbage collector and one BLAS thread while the loop runs."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def undisturbed() -> Iterator[None]:
    """Keeps the garbage collector off and BLAS at one thread inside; both are restored afterwards.

    Existing objects are frozen, so that no collection visits them. Two BLAS threads wait for one another, which costs
    the loop milliseconds at p99.
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
