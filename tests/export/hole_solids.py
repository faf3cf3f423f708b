"""What build123d documents of its hole operations, as solids: they are entered at z = 0, cut downwards, and as far above it."""

import numpy as np
from manifold3d import Manifold


def hole(segments: int, radius: float, depth: float) -> Manifold:
    return Manifold.cylinder(2 * depth, radius, radius, segments, True)


def counter_bore(segments: int, radius: float, wide: float, deep: float, depth: float) -> Manifold:
    return _rod(segments, radius, -depth, 0.0) + _rod(segments, wide, -deep, depth)


def counter_sink(segments: int, radius: float, wide: float, depth: float, angle: float) -> Manifold:
    tip = wide / np.tan(np.deg2rad(angle / 2))
    cone = Manifold.cylinder(tip, 0.0, wide, segments).translate((0.0, 0.0, -tip))
    return _rod(segments, radius, -depth, 0.0) + cone + _rod(segments, wide, 0.0, depth)


def _rod(segments: int, radius: float, low: float, high: float) -> Manifold:
    return Manifold.cylinder(high - low, radius, radius, segments).translate((0.0, 0.0, low))


HOLES = {"Hole": hole, "CounterBoreHole": counter_bore, "CounterSinkHole": counter_sink}
