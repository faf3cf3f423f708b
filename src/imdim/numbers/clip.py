"""Leaves no longer than they need to be: what reaches far out of a cloud's box takes samples from the surface that is seen."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.program.tree import Primitive, Program, map_leaves

SPANS = {"box": {0: 0, 1: 1, 2: 2}, "cylinder": {2: 1}}  # kind: local axis -> the size along it


def clip_program(program: Program, points: np.ndarray, margin: float) -> Program:
    """The program with boxes and cylinders that end `margin` outside the box of `points` [n, 3] at the latest; inside, it is the same."""
    low, high = points.min(0) - margin, points.max(0) + margin
    corners = np.array([[(low, high)[k][axis] for axis, k in enumerate(which)] for which in product((0, 1), repeat=3)])
    return map_leaves(program, lambda _, leaf: _clip_leaf(leaf, corners))


def _clip_leaf(leaf: Primitive, corners: np.ndarray) -> Primitive:
    rotation, center, size = matrix_from_euler(leaf.rotation), np.array(leaf.center), list(leaf.size)
    for axis, slot in SPANS.get(leaf.kind, {}).items():
        along = (corners - np.array(leaf.center)) @ rotation[:, axis]
        start, end = max(-leaf.size[slot] / 2, float(along.min())), min(leaf.size[slot] / 2, float(along.max()))
        if end > start and end - start < leaf.size[slot]:
            size[slot] = end - start
            center = center + (start + end) / 2 * rotation[:, axis]
    return replace(leaf, size=tuple(size), center=tuple(center.tolist()))
