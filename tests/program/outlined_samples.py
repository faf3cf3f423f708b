"""Random drawn leaves, and membership in an outline by crossings with finely sampled loops: what the formulas are held against."""

import math

import numpy as np

from imdim.program.outline import Loop, Outline, circle, ellipse, flatten_loop
from imdim.program.tree import Primitive, Vec3

ORIGIN = (0.0, 0.0, 0.0)


def random_loop(rng: np.random.Generator, x: float, y: float, radius: float) -> Loop:
    """A star-shaped ring of lines and arcs about (x, y), within `radius`."""
    count = int(rng.integers(4, 8))
    angles = 2 * math.pi * (np.arange(count) + rng.uniform(0.35, 0.65, count)) / count
    reach = rng.uniform(0.5, 0.8, count) * radius
    bulges = np.where(rng.random(count) < 0.5, rng.uniform(-0.15, 0.15, count), 0.0)
    return tuple(
        (x + r * math.cos(a), y + r * math.sin(a), float(b)) for r, a, b in zip(reach.tolist(), angles.tolist(), bulges, strict=True)
    )


def random_outline(rng: np.random.Generator, x: float = 0.0) -> Outline:
    """A ring or an ellipse about (x, 0) within 0.6, sometimes with a round hole and an island in that."""
    ring = random_loop(rng, x, 0.0, 0.6)
    own = np.random.default_rng(int(1e6 * abs(ring[0][0])))
    semi_axes = own.uniform(0.25, 0.55, 2).tolist()
    loops = [ellipse(*semi_axes, x, 0.0, float(own.uniform(-90, 90))) if own.random() < 0.3 else ring]
    if rng.random() < 0.6:
        loops.append(circle(0.09, x + 0.01, -0.01))
    if len(loops) == 2 and rng.random() < 0.5:
        loops.append(circle(0.04, x, 0.0))
    return Outline(tuple(loops))


def random_drawn(rng: np.random.Generator, kind: str, size: float, center: Vec3 = ORIGIN, rotation: Vec3 = ORIGIN) -> Primitive:
    """An extrusion as high as `size`, with walls that lean or upright ones, or an outline turned by `size` of a whole turn; a third of
    those come all round."""
    if kind == "extrude":
        return Primitive(kind, (size,), center, rotation, random_outline(rng))
    if kind == "drafted":
        return random_drafted(rng, size, center, rotation)
    angle = 360.0 if rng.random() < 1 / 3 else 360.0 * size
    return Primitive(kind, (angle,), center, rotation, random_outline(rng, 0.6) if rng.random() < 0.5 else on_axis(rng))


def random_drafted(rng: np.random.Generator, height: float, center: Vec3 = ORIGIN, rotation: Vec3 = ORIGIN) -> Primitive:
    """A star of lines or a rounded rectangle, sometimes with a round hole, whose walls lean as far as they may."""
    star = tuple((x, y, 0.0) for x, y, _ in random_loop(rng, 0.0, 0.0, 0.6))  # type: ignore[misc]
    loops: list[Loop] = (
        [rounded_rectangle(*rng.uniform(0.6, 1.0, 2).tolist(), float(rng.uniform(0.1, 0.25)))] if rng.random() < 0.5 else [star]
    )
    if rng.random() < 0.6:
        loops.append(circle(0.05, 0.01, -0.01))
    for inset in (0.08, 0.04, 0.02, 0.01, 0.005, 0.002):
        try:
            return Primitive("drafted", (height, math.degrees(math.atan(inset / height))), center, rotation, Outline(tuple(loops)))
        except ValueError:
            continue
    raise AssertionError("walls that hardly lean meet")


def rounded_rectangle(width: float, height: float, radius: float) -> Loop:
    """About the origin, counter-clockwise."""
    x, y, a, b, quarter = width / 2, height / 2, width / 2 - radius, height / 2 - radius, math.tan(math.pi / 8)
    ends = [(-a, -y), (a, -y), (x, -b), (x, b), (a, y), (-a, y), (-x, b), (-x, -b)]
    return tuple((u, v, quarter if i % 2 else 0.0) for i, (u, v) in enumerate(ends))


def on_axis(rng: np.random.Generator) -> Outline:
    """A ring one of whose lines lies along the axis."""
    h, r = rng.uniform(0.2, 0.5), rng.uniform(0.3, 0.7)
    return Outline((((0.0, -h, 0.0), (r, -h, float(rng.uniform(0, 0.4))), (r, h / 2, 0.0), (0.0, h, 0.0)),))


def wraps(outline: Outline, flat: np.ndarray, segments: int = 96) -> np.ndarray:
    """Membership [n] of points [n, 2]: by the crossings of a ray with polygons through finely sampled loops."""
    odd = np.zeros(len(flat), bool)
    x, y = flat.T
    for loop in outline.loops:
        ring = flatten_loop(loop, segments)
        for (px, py), (qx, qy) in zip(ring, (*ring[1:], ring[0]), strict=True):
            if py != qy:
                odd ^= ((py > y) != (qy > y)) & (x < px + (y - py) * (qx - px) / (qy - py))
    return odd
