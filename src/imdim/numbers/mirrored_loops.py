"""Loops that are their own mirror image but for a hair, made so: halves that are rounded curve by curve part in their last digits."""

from __future__ import annotations

import math

from imdim.numbers.carriers import tidy
from imdim.program.outline import Ring

HAIR = 2e-5  # of a loop's extent, by which its halves may differ
SAME = 1e-9  # of it, by which they differ where they are images already


def mirror_halves(ring: Ring, tolerance: float) -> Ring:
    """The loop with one half the exact image of the other, across a line along x or y, where no vertex moves by more than the tolerance
    and a hair; itself where that makes it none, or nothing has to move."""
    ends = [(min(vertex[axis] for vertex in ring), max(vertex[axis] for vertex in ring)) for axis in (0, 1)]
    extent = max(high - low for low, high in ends)
    for across in (1, 0):
        middle = sum(ends[across]) / 2
        if _partners(ring, across, middle, SAME * extent) is None:
            pairs = _partners(ring, across, middle, min(tolerance, HAIR * extent))
            ring = ring if pairs is None else tuple(_vertex(ring, k, j, across, middle) for k, j in pairs)
    return ring


def _partners(ring: Ring, across: int, middle: float, slack: float) -> list[tuple[int, int]] | None:
    """Each vertex with the one that is its image in the line where coordinate `across` is the middle, within the slack; None where one has
    none."""
    image = [_image(vertex, across, middle) for vertex in ring]
    count = len(ring)
    first = max(range(count), key=lambda k: ring[k][across])
    # the image is run through the other way round: curve k, from vertex k, is the image of the one that ends at the partner of vertex k
    for partner in range(count):
        if math.dist(image[first], ring[partner][:2]) > slack:
            continue
        pairs = [(k, (first + partner - k) % count) for k in range(count)]
        if all(math.dist(image[k], ring[j][:2]) <= slack and _is_as_bent(ring, k, (j - 1) % count, slack) for k, j in pairs):
            return pairs
    return None


def _image(vertex: tuple[float, float, float], across: int, middle: float) -> tuple[float, float]:
    x, y, _ = vertex
    return (tidy(2 * middle - x), y) if across == 0 else (x, tidy(2 * middle - y))


def _is_as_bent(ring: Ring, k: int, other: int, slack: float) -> bool:
    """Whether two curves rise as far over their chords."""
    chord = math.dist(ring[k][:2], ring[(k + 1) % len(ring)][:2])
    return abs(ring[k][2] - ring[other][2]) * chord / 2 <= slack


def _vertex(ring: Ring, k: int, j: int, across: int, middle: float) -> tuple[float, float, float]:
    """Vertex k as it is on the upper half, on the line the middle of itself, and else the image of its partner j, with the bulge of the
    curve of the upper half."""
    if k == j:
        x, y, bulge = ring[k]
        return (middle, y, bulge) if across == 0 else (x, middle, bulge)
    lower = ring[k][across] < middle
    x, y = _image(ring[j], across, middle) if lower else ring[k][:2]
    # curve k is bent as its image is, which ends at j: that of the upper half tells
    begins = ring[k][across] + ring[(k + 1) % len(ring)][across]
    return x, y, ring[k if begins >= 2 * middle else (j - 1) % len(ring)][2]
