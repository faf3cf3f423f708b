"""Morton codes: places in an order in which near ones are mostly near each other."""

from __future__ import annotations

import numpy as np


def morton(unit: np.ndarray) -> np.ndarray:
    """The codes uint64 [n] of points [n, 3] in -0.5..0.5: the bits of their coordinates by turns, 21 each."""
    cell = np.clip((unit + 0.5) * (1 << 21), 0, (1 << 21) - 1).astype(np.uint64)
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        cell = (cell | (cell << np.uint64(shift))) & np.uint64(mask)
    return cell[:, 0] | (cell[:, 1] << np.uint64(1)) | (cell[:, 2] << np.uint64(2))
