"""What one core of this machine can do at most, measured: arithmetic, square roots, memory.

Arithmetic is a product of matrices by BLAS, in both precisions: the fastest arithmetic that a program in Python can call, blocked and
written for the processor's widest registers, so that what it reaches is a peak and not what a compiler makes of a loop. Memory is the
triad ``a = b + s c`` over arrays far larger than the core's own caches (McCalpin 1995, STREAM). Square roots have a unit of their own that
takes several cycles per register: a loop over a block that stays in the nearest cache. What branches at each point computes one number at
a time: ten sums that do not wait for each other are the most that such code can do.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

SIDE = 1024  # of the matrices
STREAM = 8 << 20  # numbers in each array of the triad: 64 MiB
BLOCK, ROUNDS = 2048, 200  # of the square roots
CHAIN = 1 << 19  # steps of the ten sums


@dataclass(frozen=True)
class Peaks:
    """Operations per second in single and double precision, bytes per second, square roots per second in both precisions, and operations
    per second in double precision, one number at a time."""

    single: float
    double: float
    stream: float
    roots_single: float
    roots_double: float
    scalar: float


class Micro:
    """The micro-kernels with their arrays, to be measured again and again beside other things."""

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        self.matrices = {dtype: rng.random((2, SIDE, SIDE)).astype(dtype) for dtype in (np.float32, np.float64)}
        self.lines = {dtype: rng.random((2, BLOCK)).astype(dtype) for dtype in (np.float32, np.float64)}
        self.arrays = np.ones((3, STREAM))
        self.measured()

    def measured(self) -> Peaks:
        """Rates of this moment."""
        product = 2.0 * SIDE**3
        single, double = (product / seconds(lambda m=m: m[0] @ m[1]) for m in self.matrices.values())
        stream = 24.0 * STREAM / seconds(lambda: _triad(*self.arrays, 0.5))
        single_line, double_line = self.lines.values()
        roots = [BLOCK * ROUNDS / seconds(run) for run in (lambda: _fast_roots(*single_line), lambda: _roots(*double_line))]
        scalar = 20.0 * CHAIN / seconds(lambda: _ten_sums(CHAIN, 0.9, 0.1))
        return Peaks(single, double, stream, *roots, scalar)


def seconds(run: Callable[[], object]) -> float:
    """Of the processor, in this process: what others do on the core meanwhile is left out."""
    start = time.process_time()
    run()
    return time.process_time() - start


@njit(nogil=True, cache=True, fastmath=True)
def _triad(a, b, c, s):  # pragma: no cover - compiled
    for i in range(len(a)):
        a[i] = b[i] + s * c[i]


@njit(nogil=True, cache=True, fastmath=True)
def _fast_roots(x, out):  # pragma: no cover - compiled
    # as population scoring has them: an estimate and a step of Newton's
    for _ in range(ROUNDS):
        for i in range(len(x)):
            out[i] = math.sqrt(x[i])


@njit(nogil=True, cache=True)
def _roots(x, out):  # pragma: no cover - compiled
    for _ in range(ROUNDS):
        for i in range(len(x)):
            out[i] = math.sqrt(x[i])


@njit(nogil=True, cache=True)
def _ten_sums(n, a, b):  # pragma: no cover - compiled
    x0 = x1 = x2 = x3 = x4 = x5 = x6 = x7 = x8 = x9 = b
    for _ in range(n):
        x0, x1, x2, x3, x4 = x0 * a + b, x1 * a + b, x2 * a + b, x3 * a + b, x4 * a + b
        x5, x6, x7, x8, x9 = x5 * a + b, x6 * a + b, x7 * a + b, x8 * a + b, x9 * a + b
    return x0 + x1 + x2 + x3 + x4 + x5 + x6 + x7 + x8 + x9
