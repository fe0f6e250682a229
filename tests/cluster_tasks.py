"""Tasks for the processes of a cluster, which import this file alone and not the tests."""

import os
import time

import numpy as np

from motiondeck_base.errors import MotiondeckError


def product(seed, size=60):
    """Sums whose order matters, so that another number of BLAS threads would show."""
    generator = np.random.default_rng(seed)
    matrix = generator.standard_normal((size, size))
    return seed, os.getpid(), np.linalg.svd(matrix @ matrix.T)[0]


def dies_once(number, mark):
    if number == 5 and not mark.exists():
        mark.touch()
        os._exit(1)
    return number


def dies(number):
    os._exit(1)


def refuses(number):
    if number == 3:
        raise MotiondeckError(f"task {number} is refused")
    return number


def alone_in_its_process(number, folder):
    mark = folder / f"{os.getpid()}"
    mark.touch(exist_ok=False)
    time.sleep(0.02)
    mark.unlink()
    return number
