"""Whether noise may hide that a surface of a program is two skins of a thin wall.

Where both skins were taken for one, the points lie on either side of it, and fewer lie close to it than noise of their deviation leaves:
of a normal distribution 0.38 lie within half a deviation, and 0.48 between that and one and a half; of two, each 1.05 of its deviations
off the middle, 0.34 and 0.53 do so.
"""

from __future__ import annotations

import numpy as np

from imdim.geometry.kernels import program_sdf
from imdim.program.tree import Program

CLOSE, BESIDE = 0.5, 1.5  # deviations of the noise
BARE = 0.77  # as many lie close to a surface as beside it, of which a normal distribution has 0.79


def may_hide_skins(program: Program, points: np.ndarray, sigma: float) -> bool:
    """Whether so few of `points` [n, 3] lie close to a program's surface as do where some of it is two skins in noise that is less than
    `sigma`."""
    off = np.abs(program_sdf(program, points)) / sigma
    return bool(np.count_nonzero(off < CLOSE) < BARE * np.count_nonzero((off >= CLOSE) & (off < BESIDE)))
