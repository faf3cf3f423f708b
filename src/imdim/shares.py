"""What is worked out point by point, by two threads where there is a second core."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from imdim.side_process import has_second_core

SHARES = 8  # of which each thread takes the next one: some take longer
ENOUGH = 4096  # points: another thread begins in the time that kernels take for some hundred


def by_shares(compute: Callable[[np.ndarray], np.ndarray], points: np.ndarray) -> np.ndarray:
    """What `compute` gives for `points` [n, ..], a row for each.

    Two threads take shares of them by turns, where there are enough and a core for it: `compute` has to look at each point alone, and to
    let the other run, as kernels without the interpreter's lock do.
    """
    if len(points) < ENOUGH or not has_second_core():
        return compute(points)
    with ThreadPoolExecutor(2) as pool:
        try:
            return np.concatenate([*pool.map(compute, np.array_split(points, SHARES))])
        except RuntimeError:  # no memory for a thread, or too many
            return compute(points)
