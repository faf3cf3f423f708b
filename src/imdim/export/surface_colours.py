"""Surfaces coloured by what is known of them: what became of a target's, and what of a result's a cloud shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import trimesh

VERDICTS = ("exact", "approximated", "left out")
COLOURS = np.array([[222, 226, 230], [244, 178, 60], [190, 30, 60]], float)  # light grey, amber, crimson
COVERAGES = ("seen", "inferred", "unknown")
COVERAGE_COLOURS = np.array([[112, 158, 204], [186, 164, 214], [228, 128, 96]], float)  # blue, violet, brick


@dataclass(frozen=True, eq=False)
class ColouredTarget:
    """A target's surface as a `mesh` of small faces, None for a cloud, with the verdict on each face or point: `codes` [n], places in
    VERDICTS. `shares` of the surface by verdict, in words."""

    mesh: trimesh.Trimesh | None
    codes: np.ndarray
    shares: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class ColouredResult:
    """A result's surface as a `mesh` of small faces, with what a cloud shows of each: `codes` [n], places in COVERAGES. `shares` of the
    surface by coverage, in words."""

    mesh: trimesh.Trimesh
    codes: np.ndarray
    shares: Mapping[str, str]
