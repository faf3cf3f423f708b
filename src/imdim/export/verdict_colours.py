"""A target's surface coloured by what became of it: the words, the colours, and the pieces that pictures draw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import trimesh

VERDICTS = ("exact", "approximated", "left out")
COLOURS = np.array([[222, 226, 230], [244, 178, 60], [190, 30, 60]], float)  # light grey, amber, crimson


@dataclass(frozen=True, eq=False)
class ColouredTarget:
    """A target's surface as a `mesh` of small faces, None for a cloud, with the verdict on each face or point: `codes` [n], places in
    VERDICTS. `shares` of the surface by verdict, in words."""

    mesh: trimesh.Trimesh | None
    codes: np.ndarray
    shares: Mapping[str, str]
