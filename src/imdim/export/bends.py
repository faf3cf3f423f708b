"""What the texts write for arcs in place of bulges, worked out: where the vertices are, and the bulges.

The texts have these functions themselves, in their own languages.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

from imdim.program.outline import Loop

Arc = float | tuple[float, ...] | str  # a bulge, (x, y, way), (r, way), (r,), or one of SIDES
SIDES = ("before", "after", "cusp before", "cusp after")  # the curve that an arc touches, and whether it comes back along that


def to_loop(vertices: Sequence[tuple[float, float, Arc]]) -> Loop:
    """The loop; raises ValueError, one line, where an arc cannot be as it is told."""
    at, arcs = _round_corners(vertices)
    bulges = [math.tan(half / 2) if isinstance(arc, tuple | str) else arc for arc, half in zip(arcs, _half_turns(at, arcs), strict=True)]
    return tuple((p.real, p.imag, bulge) for p, bulge in zip(at, bulges, strict=True))


def regular_polygon(sides: float, radius: float, x: float = 0.0, y: float = 0.0, angle: float = 0.0) -> Loop:
    """A regular polygon with a corner at `angle` degrees, counter-clockwise; raises ValueError for a count of sides that is none."""
    if not (sides >= 3 and sides == int(sides)):
        raise ValueError(f"a polygon needs a whole number of 3 or more sides, got {sides:g}")
    if not radius > 0:
        raise ValueError(f"a polygon needs a positive radius, got {radius:g}")
    corners = [cmath.rect(radius, math.radians(angle) + 2 * math.pi * k / sides) for k in range(int(sides))]
    return tuple((x + c.real, y + c.imag, 0.0) for c in corners)


def polygon_across_flats(sides: float, width: float, x: float = 0.0, y: float = 0.0, angle: float = 0.0) -> Loop:
    """The same by twice the radius of the circle that its sides touch."""
    return regular_polygon(sides, width / 2 / math.cos(math.pi / max(sides, 3)), x, y, angle)


def _round_corners(vertices: Sequence[tuple[float, float, Arc]]) -> tuple[list[complex], list[Arc]]:
    """Vertices and arcs without those that stand at a corner or at their centre: these have bulges and ends of their own."""
    n, at, arcs = len(vertices), [complex(x, y) for x, y, _ in vertices], [arc for _, _, arc in vertices]
    places, found, radii = list(at), list(arcs), _end_radii(at, arcs)
    for i, arc in enumerate(arcs):
        j = (i + 1) % n
        if isinstance(arc, tuple) and len(arc) == 1:
            into, out = at[i] - at[i - 1], at[(i + 2) % n] - at[i]
            if n < 4 or at[j] != at[i] or not into or not out:
                raise ValueError("an arc [r] rounds a corner that stands at both its ends, between two lines")
            turn = cmath.phase(out / into)
            length = arc[0] * math.tan(abs(turn) / 2)
            places[i], places[j] = at[i] - length * into / abs(into), at[i] + length * out / abs(out)
            found[i] = math.tan(turn / 4)
        elif isinstance(arc, tuple) and i in radii and len(arc) == 2 and at[i] == at[j]:
            into, out = (_touching_line(at, radii, k % n) for k in (i - 1, j))
            places[i], places[j] = at[i] - radii[i] * 1j * into, at[i] - radii[i] * 1j * out
            found[i] = arc[1] * math.tan(arc[1] * cmath.phase(out / into) % (2 * math.pi) / 4)
    return places, found


def _end_radii(at: list[complex], arcs: list[Arc]) -> dict[int, float]:
    """The radii of arcs that stand at their centre, negative for clockwise ones, by the vertices at both their ends."""
    n = len(at)
    ends = [i for i, arc in enumerate(arcs) if isinstance(arc, tuple) and len(arc) == 2 and at[i] == at[(i + 1) % n]]
    return {k: arcs[i][0] * arcs[i][1] for i in ends for k in (i, (i + 1) % n)}  # type: ignore[operator, index]


def _touching_line(at: list[complex], radii: dict[int, float], i: int) -> complex:
    """The direction of the line from vertex i to the next one that touches the circles about them; a corner is one of radius 0."""
    j = (i + 1) % len(at)
    between, off = at[j] - at[i], radii.get(j, 0.0) - radii.get(i, 0.0)
    if not abs(off) < abs(between):
        raise ValueError(f"no line touches circles whose centres are {abs(between):g} apart and whose radii differ by {abs(off):g}")
    return between / abs(between) * cmath.exp(-1j * math.asin(off / abs(between)))


def _half_turns(at: list[complex], arcs: list[Arc]) -> list[float]:
    """Half the angle by which each curve turns, in radians."""
    n = len(at)
    chords = [at[(i + 1) % n] - p for i, p in enumerate(at)]
    known: dict[int, float] = {}

    def half(i: int, depth: int = 0) -> float:
        if i not in known:
            known[i] = find(i, depth)
        return known[i]

    def find(i: int, depth: int) -> float:
        arc = arcs[i]
        if arc in SIDES:
            side = 1 if str(arc).endswith("before") else -1
            j, on = (i - side) % n, -1 if str(arc).startswith("cusp") else 1
            if depth == n or not chords[i] or not chords[j]:
                raise ValueError("an arc that touches its neighbour needs one that does not touch it in turn, and a length")
            return side * cmath.phase(on * chords[i] / (chords[j] * cmath.exp(side * 1j * half(j, depth + 1))))
        return _half_turn(arc, at[i], at[(i + 1) % n])  # type: ignore[arg-type]

    return [half(i) for i in range(n)]


def _half_turn(arc: float | tuple[float, ...], start: complex, end: complex) -> float:
    if not isinstance(arc, tuple):
        return 2 * math.atan(arc)
    if arc[-1] not in (1, -1):
        raise ValueError(f"an arc runs 1 or -1, counter-clockwise or clockwise, not {arc[-1]:g}")
    way = arc[-1]
    if len(arc) == 2:
        if not abs(end - start) <= 2 * arc[0]:
            raise ValueError(f"an arc of radius {arc[0]:g} does not span {abs(end - start):g}")
        return way * math.asin(abs(end - start) / 2 / arc[0])
    center = complex(arc[0], arc[1])
    if center in (start, end):
        raise ValueError("an arc ends in its centre")
    return way * (way * cmath.phase((end - center) / (start - center)) % (2 * math.pi)) / 2
