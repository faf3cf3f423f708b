"""Lines and arcs for the points along a border: the cheapest row of them, by dynamic programming over the places where one may end.

What a line or an arc leaves of its points is known from sums of powers of their coordinates (Taubin 1991 for the circle), so that all
pairs of places can be looked at. Neighbours meet where their carriers cross; lines that
the points cannot tell from ones along x or y are made so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from imdim.geometry import kernels
from imdim.geometry.conic import fit_conic
from imdim.geometry.lowering import Outlines
from imdim.program.ellipse import Ellipse
from imdim.program.outline import CrossingError, Loop, Outline, Ring, Vertex, check_crossings, circle, loop_area

PLACES = 260  # along a border, at most
STEP = 1.5  # deviations of the noise between them, at least
OFF = 2.0  # cells that a border may lie off its points
OWN = 4.0  # deviations of the noise, within which a border has its points
FAINT = 0.02  # points that a place without any counts for, so that curves go on through gaps
PRICE = 1.5  # times what a number costs by the description length
SAGITTA = 3.0  # deviations of the noise by which an arc leaves its chord
MOST_TURN = 5.5  # radians of one arc
OPEN = 5.9  # radians of a circle with a gap: what seems to turn by more runs back a little
HALVED = 3.6  # radians of an arc, beyond which it is drawn in two halves
LEVEL = 1.2  # deviations of the noise by which the ends of a line may leave x or y
SLANTED = 12.0  # times half the logarithm of the number of points: what a slant must tell them better, since strays at corners tilt lines
ALIKE = 0.12  # sine of the angle below which two lines do not cross where they meet
ASTRAY = 10.0  # deviations of the noise that a corner may lie off the border
LEAST = 3.0  # deviations of the noise, the side of the smallest loop
FEWEST_ARCS = 4  # curves that an ellipse may take the place of
CONIC = 5  # numbers of an ellipse
BENDING = 12.0  # deviations of the noise, the length of an arc that is told from a blurred corner
SHORT = 8.0  # deviations of the noise, the chord of a piece whose points spread no less across it
BEHIND = 6.0  # prices of a number by which a place may be dearer: an arc has one more than a line, and its fit is none of least squares
NEWTON = 20  # steps, of which two or three are taken
SMOOTHED = 2  # corners of a border to either side


@dataclass(frozen=True)
class _Line:
    """A carrier through `at` along the unit vector `way`; `level` is the coordinate that is the same all along, -1 for none."""

    at: np.ndarray
    way: np.ndarray
    level: int = -1


@dataclass(frozen=True)
class _Arc:
    """A carrier about `center`, run counter-clockwise where `sign` is 1."""

    center: np.ndarray
    radius: float
    sign: float


_Carrier = _Line | _Arc


def fit_outline(borders: Sequence[np.ndarray], cell: float, points: np.ndarray, sigma: float, turned: bool) -> Outline | None:
    """Loops of lines and arcs along closed `borders` [m, 2], right to a `cell`, for the `points` [n, 2] beside them, the largest first and
    without those that cross a larger one; None where they make no outline.

    If `turned`, x is the distance from an axis, along which loops need no curve.
    """
    large = [border for border in borders if np.ptp(border, axis=0).min() > LEAST * sigma]
    price = PRICE * 0.5 * math.log(max(len(points), 2))
    shared = zip(large, _share_out(points, large), strict=True)
    loops = [loop for border, own in shared if (loop := _fit_sound_loop(border, cell, own, sigma, price, turned)) is not None]
    loops.sort(key=lambda loop: -abs(loop_area(loop)))
    while loops:
        try:
            outline = Outline(tuple(loops))
            check_crossings(outline)
        except CrossingError as error:
            smaller = max(i for i, _ in error.curves)
            if smaller == 0:
                return None
            del loops[smaller]
        except ValueError:
            return None
        else:
            return outline
    return None


def _share_out(points: np.ndarray, borders: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The `points` [n, 2] that are nearest to each of the borders [m, 2]: beyond a thin wall lie those of another."""
    if len(borders) < 2:
        return [points] * len(borders)
    nearest = np.asarray(KDTree(np.concatenate(borders)).query(points)[1])
    of = np.repeat(np.arange(len(borders)), [len(border) for border in borders])[nearest]
    return [points[of == k] for k in range(len(borders))]


def _fit_sound_loop(border: np.ndarray, cell: float, points: np.ndarray, sigma: float, price: float, turned: bool) -> Loop | None:
    """The loop along a border that tells the points [n, 2] beside it best: of lines and arcs, of lines alone, since arcs that are right for
    short stretches may meet where nothing is, or an ellipse. None where each crosses itself or the axis, or bounds hardly anything."""
    places, reach = _space_out(border, sigma), max(OWN * sigma, OFF * cell)
    points = points[((points > places.min(0) - reach) & (points < places.max(0) + reach)).all(1)]
    own = np.asarray(KDTree(places).query(points, distance_upper_bound=reach)[1])
    beside = np.ascontiguousarray(points[own < len(places)])
    sums = _sum_powers(places, points, own)
    on_axis = places[:, 0] < 1.5 * sigma if turned else np.zeros(len(places), bool)
    curved = _fit_loop(places, sums, on_axis, sigma, price, MOST_TURN)
    has_arcs = curved is None or any(bulge for *_, bulge in curved)
    drawn: list[Loop | None] = [curved, _fit_loop(places, sums, on_axis, sigma, price, 0.0) if has_arcs else None]
    if not on_axis.any() and (curved is None or len(curved) >= FEWEST_ARCS):
        drawn.append(_ellipse_through(places, beside, sigma))
    sound = [loop for loop in drawn if loop and _is_sound(loop, sigma, turned)]
    return min(sound, key=lambda loop: _cost(loop, beside, sigma, price)) if sound else None


def _is_sound(loop: Loop, sigma: float, turned: bool) -> bool:
    """Whether a loop bounds something and crosses neither itself nor the axis that it is `turned` about."""
    if abs(loop_area(loop)) <= (LEAST * sigma) ** 2:
        return False
    try:
        alone = Outline((loop,))
        check_crossings(alone)
    except ValueError:
        return False
    return not turned or alone.bounds[0][0] >= 0


def _fit_loop(places: np.ndarray, sums: np.ndarray, on_axis: np.ndarray, sigma: float, price: float, most_turn: float) -> Ring | None:
    """The cheapest row of curves along the places [m, 2] of a border, from the axis and back to it where some lie `on_axis`."""
    vertices: list[Vertex] = []
    if on_axis.all():
        return None
    if not on_axis.any():
        vertices = _fit_ring(places, sums, sigma, price, most_turn)
    else:
        shift = int(np.flatnonzero(on_axis & ~np.roll(on_axis, -1))[0]) + 1
        places, sums, on_axis = np.roll(places, -shift, 0), np.roll(sums, -shift, 0), np.roll(on_axis, -shift)
        edges = np.flatnonzero(np.diff(np.concatenate([[1], on_axis.astype(int), [1]])))
        for first, last in zip(edges[::2], edges[1::2], strict=True):
            if last - first > 1:
                vertices += _fit_chain(places[first:last], sums[first:last], sigma, price, most_turn)
    vertices = _drop_short(vertices)
    return tuple(vertices) if len(vertices) > 2 or (len(vertices) == 2 and any(b for _, _, b in vertices)) else None


def _ellipse_through(places: np.ndarray, points: np.ndarray, sigma: float) -> Ellipse | None:
    """The ellipse through the `points` [n, 2] beside the `places` [m, 2] of a border; None where either of both lie on no ellipse."""
    for some in (places, points):
        conic = fit_conic(some) if len(some) > CONIC else None
        if conic is None:
            return None
        (x, y), axes, (rx, ry) = conic
        angle = math.degrees(math.atan2(axes[1, 0], axes[0, 0]))
        ellipse = Ellipse(float(rx), float(ry), float(x), float(y), angle).plain
        if not LEAST * sigma / 2 < min(rx, ry) <= max(rx, ry) < 10 * float(np.ptp(places, axis=0).max()):
            return None
    return ellipse


def _cost(loop: Loop, points: np.ndarray, sigma: float, price: float) -> float:
    """What a loop leaves of the squared distances of `points` [n, 2], and what its numbers cost; infinite for one that bounds nothing."""
    try:
        outline = Outline((loop,))
    except ValueError:
        return math.inf
    off = kernels.outline_sdf(Outlines.pack([outline]).curves, points)
    count = CONIC if isinstance(loop, Ellipse) else sum(2 + (bulge != 0) for _, _, bulge in loop)
    return float((off**2).sum()) / (2 * sigma**2) + price * count


def _space_out(border: np.ndarray, sigma: float) -> np.ndarray:
    """Places [m, 2] along a closed border, evenly, its steps smoothed."""
    smooth = np.mean([np.roll(border, k, 0) for k in range(-SMOOTHED, SMOOTHED + 1)], axis=0)
    ring = np.vstack([smooth, smooth[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    count = int(np.clip(length[-1] / (STEP * sigma), 8, PLACES))
    at = np.arange(count) * length[-1] / count
    return np.column_stack([np.interp(at, length, ring[:, c]) for c in (0, 1)])


def _sum_powers(places: np.ndarray, points: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Of each place the sums of 1, x, y, xx, xy, yy, xz, yz, zz [m, 9] over its points and, faintly, itself; z is xx + yy."""
    mine = own < len(places)
    where = np.concatenate([own[mine], np.arange(len(places))])
    at = np.concatenate([points[mine], places])
    weight = np.repeat([1.0, FAINT], [int(mine.sum()), len(places)])
    x, y = at.T
    z = x * x + y * y
    powers = (np.ones_like(x), x, y, x * x, x * y, y * y, x * z, y * z, z * z)
    return np.stack([np.bincount(where, weight * p, len(places)) for p in powers], axis=1)


def _fit_ring(places: np.ndarray, sums: np.ndarray, sigma: float, price: float, most_turn: float) -> list[Vertex]:
    """The vertices of a closed loop; a full circle where that is cheapest."""
    ends, cost = _split(np.vstack([places, places[:1]]), sums, sigma, price, most_turn, SAGITTA)
    for _ in range(2):  # the first place is a corner by chance only: begin again at one that was found
        corner = int(ends[len(ends) // 2 - (len(ends) > 2)]) % len(places) if len(ends) > 1 else 0
        if corner == 0:
            break
        places, sums = np.roll(places, -corner, 0), np.roll(sums, -corner, 0)
        ends, cost = _split(np.vstack([places, places[:1]]), sums, sigma, price, most_turn, SAGITTA)
    _, left, x, y, radius = _carrier_of(sums.sum(0), 1)
    if left / (2 * sigma**2) + 3 * price < cost and radius > LEAST * sigma / 2:
        return list(circle(radius, x, y))
    bounds = [0, *ends.tolist()]
    carriers = _carry_all(places, sums, bounds, sigma, price, most_turn)
    if len(carriers) < 2:
        return []
    corners = [_meet(carriers[i - 1], carriers[i], places[bounds[i]], sigma) for i in range(len(carriers))]
    return _join(carriers, [*corners, corners[0]])


def _fit_chain(places: np.ndarray, sums: np.ndarray, sigma: float, price: float, most_turn: float) -> list[Vertex]:
    """The vertices of a chain from the axis and back to it."""
    ends, _ = _split(np.vstack([places, places[-1:]]), sums, sigma, price, most_turn, SAGITTA)
    bounds = [0, *ends.tolist()]
    carriers = _carry_all(places, sums, bounds, sigma, price, most_turn)
    axis = _Line(np.zeros(2), np.array([0.0, 1.0]), 0)
    corners = [[_onto_axis(axis, carriers[0], places[0], sigma)]]
    corners += [_meet(carriers[i - 1], carriers[i], places[bounds[i]], sigma) for i in range(1, len(carriers))]
    corners.append([_onto_axis(axis, carriers[-1], places[-1], sigma)])
    return [*_join(carriers, corners), (*corners[-1][0], 0.0)]


def _join(carriers: Sequence[_Carrier], corners: Sequence[list[tuple[float, float]]]) -> list[Vertex]:
    """The vertices of carriers from each of the corners, one more than they, to the next."""
    vertices: list[Vertex] = []
    for carrier, (here, there) in zip(carriers, pairwise(corners), strict=True):
        vertices += [(*place, 0.0) for place in here[:-1]]
        vertices += _draw(carrier, here[-1], there[0])
    return vertices


def _carry_all(places: np.ndarray, sums: np.ndarray, bounds: Sequence[int], sigma: float, price: float, most_turn: float) -> list[_Carrier]:
    """The carriers of the places between `bounds`; neighbouring arcs that one circle tells as cheaply have it in common."""
    carriers = [_carry(places, sums, i, j, sigma, most_turn) for i, j in pairwise(bounds)]
    totals = [sums[i:j].sum(0) for i, j in pairwise(bounds)]
    for i, carrier in enumerate(carriers):
        before = carriers[i - 1]
        if i == 0 or not isinstance(carrier, _Arc) or not isinstance(before, _Arc) or before.sign != carrier.sign:
            continue
        both = totals[i - 1] + totals[i]
        _, left, x, y, radius = _carrier_of(both, 1)
        apart = _carrier_of(totals[i - 1], 1)[1] + _carrier_of(totals[i], 1)[1]
        if left - apart < 2 * sigma**2 * 3 * price:
            shared = _Arc(np.array([x, y]), radius, carrier.sign)
            carriers = [shared if c is before or k == i else c for k, c in enumerate(carriers)]
            totals[i] = both
    return carriers


def _carry(places: np.ndarray, sums: np.ndarray, first: int, last: int, sigma: float, most_turn: float) -> _Carrier:
    """The cheaper carrier of the places from `first` to `last`."""
    chord = places[last % len(places)] - places[first]
    total = sums[first:last].sum(0)
    _, _, kind, x, y, u, v = _choose(total, chord[0], chord[1], 0.5 * math.log(max(total[0], 2.0)), sigma, most_turn, SAGITTA)
    if kind == 1:
        center, middle = np.array([x, y]), places[(first + last) // 2]
        arm = middle - center
        ahead = places[min((first + last) // 2 + 1, len(places) - 1)] - places[max((first + last) // 2 - 1, 0)]
        return _Arc(center, u, float(np.sign(arm[0] * ahead[1] - arm[1] * ahead[0])) or 1.0)
    way = np.array([u, v]) * (np.sign(u * chord[0] + v * chord[1]) or 1.0)
    for c in (0, 1):
        if abs(way[c]) * np.hypot(*chord) / 2 < LEVEL * sigma and abs(way[c]) < 0.5 and not _is_slanted(total, c, sigma):
            level = np.eye(2)[1 - c] * np.sign(way[1 - c])
            return _Line(np.array([x, y]), level, c)
    return _Line(np.array([x, y]), way)


def _is_slanted(total: np.ndarray, c: int, sigma: float) -> bool:
    """Whether a slanted line tells points with these sums of powers clearly better than one along which coordinate `c` is the same."""
    n = max(total[0], 2.0)
    level = total[3 + 2 * c] - total[1 + c] ** 2 / n
    return bool(level - _carrier_of(total, 0)[1] > 2 * sigma**2 * SLANTED * 0.5 * math.log(n))


def _meet(a: _Carrier, b: _Carrier, near: np.ndarray, sigma: float) -> list[tuple[float, float]]:
    """The corner of two carriers near a place; two of them, the ends of a step, where they do not cross there."""
    options = [p for p in _cross(a, b) if np.hypot(*(p - near)) < ASTRAY * sigma]
    if options:
        return [_levelled(min(options, key=lambda p: float(np.hypot(*(p - near)))), a, b)]
    first, second = _foot(a, near), _foot(b, near)
    if np.hypot(*(second - first)) < 2 * sigma:
        return [_levelled((first + second) / 2, a, b)]
    return [_levelled(first, a), _levelled(second, b)]


def _onto_axis(axis: _Line, carrier: _Carrier, near: np.ndarray, sigma: float) -> tuple[float, float]:
    options = [p for p in _cross(axis, carrier) if abs(p[1] - near[1]) < ASTRAY * sigma]
    y = min(options, key=lambda p: abs(p[1] - near[1]))[1] if options else _foot(carrier, near)[1]
    return (0.0, float(y))


def _levelled(point: np.ndarray, *carriers: _Carrier) -> tuple[float, float]:
    """The point exactly on those of its carriers that are level."""
    out = [float(point[0]), float(point[1])]
    for carrier in carriers:
        if isinstance(carrier, _Line) and carrier.level >= 0:
            out[carrier.level] = float(carrier.at[carrier.level])
    return (out[0], out[1])


def _foot(carrier: _Carrier, point: np.ndarray) -> np.ndarray:
    if isinstance(carrier, _Line):
        return carrier.at + ((point - carrier.at) @ carrier.way) * carrier.way
    arm = point - carrier.center
    return carrier.center + carrier.radius * arm / max(float(np.hypot(*arm)), 1e-300)


def _cross(a: _Carrier, b: _Carrier) -> list[np.ndarray]:
    if isinstance(a, _Line) and isinstance(b, _Line):
        sine = a.way[0] * b.way[1] - a.way[1] * b.way[0]
        if abs(sine) < ALIKE:
            return []
        to = b.at - a.at
        return [a.at + (to[0] * b.way[1] - to[1] * b.way[0]) / sine * a.way]
    if isinstance(a, _Line) and isinstance(b, _Arc):
        foot = a.at + ((b.center - a.at) @ a.way) * a.way
        left = b.radius**2 - float(((foot - b.center) ** 2).sum())
        return [] if left < 0 else [foot - math.sqrt(left) * a.way, foot + math.sqrt(left) * a.way]
    if isinstance(a, _Arc) and isinstance(b, _Line):
        return _cross(b, a)
    assert isinstance(a, _Arc)
    assert isinstance(b, _Arc)
    to = b.center - a.center
    d = float(np.hypot(*to))
    along = (d * d + a.radius**2 - b.radius**2) / (2 * d) if d > 0 else math.inf
    left = a.radius**2 - along * along
    if not left >= 0:
        return []
    aside = math.sqrt(left) * np.array([-to[1], to[0]]) / d
    return [a.center + along * to / d - aside, a.center + along * to / d + aside]


def _draw(carrier: _Carrier, start: tuple[float, float], end: tuple[float, float]) -> list[Vertex]:
    """The curve from the start along a carrier, in two halves where it turns by more than HALVED, and straight where hardly anything is
    left of the circle."""
    if isinstance(carrier, _Line):
        return [(*start, 0.0)]
    a, b = (math.atan2(y - carrier.center[1], x - carrier.center[0]) for x, y in (start, end))
    turn = (carrier.sign * (b - a)) % (2 * math.pi)
    if turn < HALVED:
        return [(*start, carrier.sign * math.tan(turn / 4))]
    if turn > OPEN:
        return [(*start, 0.0)]
    middle, bulge = a + carrier.sign * turn / 2, carrier.sign * math.tan(turn / 8)
    x, y = carrier.center + carrier.radius * np.array([math.cos(middle), math.sin(middle)])
    return [(*start, bulge), (float(x), float(y), bulge)]


def _drop_short(vertices: list[Vertex]) -> list[Vertex]:
    """Without vertices at which the next one lies too."""
    return [v for v, after in zip(vertices, [*vertices[1:], *vertices[:1]], strict=True) if math.dist(v[:2], after[:2]) > 1e-9]


@njit(cache=True)
def _carrier_of(total, kind):  # pragma: no cover - compiled
    """Kind, squares left, and the numbers of the line (a place and its direction) or the circle (centre and radius) for sums of powers."""
    n = total[0]
    mx, my = total[1] / n, total[2] / n
    xx, xy, yy = total[3] - n * mx * mx, total[4] - n * mx * my, total[5] - n * my * my
    if kind == 0:
        half, off = (xx + yy) / 2, math.sqrt(((xx - yy) / 2) ** 2 + xy * xy)
        angle = 0.5 * math.atan2(2 * xy, xx - yy)
        return 0.0, max(half - off, 0.0), mx, my, angle
    # about the mean: z' = z - 2 m.p + m.m
    mm = mx * mx + my * my
    z = total[3] + total[5] - n * mm
    xz = total[6] - 2 * (mx * total[3] + my * total[4]) + mm * total[1] - mx * z
    yz = total[7] - 2 * (mx * total[4] + my * total[5]) + mm * total[2] - my * z
    zz = total[8] - 4 * (mx * total[6] + my * total[7]) + 2 * mm * (total[3] + total[5])
    zz += 4 * (mx * mx * total[3] + 2 * mx * my * total[4] + my * my * total[5]) - 4 * mm * (mx * total[1] + my * total[2]) + n * mm * mm
    a, b = _center_of(xx / n, xy / n, yy / n, xz / n, yz / n, zz / n)
    if not (a * a + b * b < np.inf):
        return 1.0, np.inf, mx, my, 0.0
    radius = math.sqrt(z / n + a * a + b * b)
    left = zz - z * z / n - 4 * (a * xz + b * yz) + 4 * (a * a * xx + 2 * a * b * xy + b * b * yy)
    return 1.0, max(left, 0.0) / max(4 * radius * radius, 1e-300), mx + a, my + b, radius


@njit(cache=True)
def _center_of(xx, xy, yy, xz, yz, zz):  # pragma: no cover - compiled
    """The centre of the circle through points about their mean, by the means of products of x, y and z = x^2 + y^2 (Taubin 1991, by
    Newton's method as Chernov 2010, section 5.9): the one of Kasa is far too small for an arc that leaves its chord by a few deviations.
    Not finite where they lie on a line."""
    z, area = xx + yy, xx * yy - xy * xy
    spread = zz - z * z
    # the least root of c + root (d + root (e + 4 z root)), to which the method falls from nothing
    c = xz * (xz * yy - yz * xy) + yz * (yz * xx - xz * xy) - spread * area
    d, e = spread * z + 4 * area * z - xz * xz - yz * yz, -3 * z * z - zz
    root, value = 0.0, c
    for _ in range(NEWTON):
        slope = d + root * (2 * e + 12 * z * root)
        after = root - value / slope if slope != 0 else root
        left = c + after * (d + after * (e + 4 * z * after))
        if after == root or not abs(left) < abs(value):
            break
        root, value = after, left
    det = root * root - root * z + area
    if abs(det) <= 1e-12 * z * z:
        return np.inf, np.inf
    return (xz * (yy - root) - yz * xy) / det / 2, (yz * (xx - root) - xz * xy) / det / 2


@njit(cache=True)
def _choose(total, ux, uy, price, sigma, most_turn, sagitta):  # pragma: no cover - compiled
    """The cost of what goes on by the chord (ux, uy), what any line or circle leaves of it, and whether it is a circle's, with its numbers:
    of a line a place and the direction, of a circle centre, radius and 0."""
    _, left, x, y, angle = _carrier_of(total, 0)
    chord = math.sqrt(ux * ux + uy * uy)
    if 0 < chord < SHORT * sigma:  # the points of a short piece spread no less across it
        angle = math.atan2(uy, ux)
        a, b, n = -uy / chord, ux / chord, total[0]
        left = a * a * (total[3] - n * x * x) + 2 * a * b * (total[4] - n * x * y) + b * b * (total[5] - n * y * y)
    least = left / (2 * sigma * sigma)
    cost = least + 2 * price
    if least <= price:  # no circle, with a number more, is cheaper
        return cost, least, 0.0, x, y, math.cos(angle), math.sin(angle)
    _, bent, cx, cy, radius = _carrier_of(total, 1)
    least = min(least, bent / (2 * sigma * sigma))
    if bent < left and radius > sagitta * sigma and radius < 1e3 * (chord + sigma):
        # half the turn from the spread along the arc: what is more than a chord away is more than half a circle
        half = math.asin(min(chord / (2 * radius), 1.0))
        if (x - cx) ** 2 + (y - cy) ** 2 < (0.6366 * radius) ** 2:
            half = math.pi - half
        if radius * (1 - math.cos(half)) > sagitta * sigma and 2 * half < most_turn and 2 * half * radius > BENDING * sigma:
            round_cost = bent / (2 * sigma * sigma) + 3 * price
            if round_cost < cost:
                return round_cost, least, 1.0, cx, cy, radius, 0.0
    return cost, least, 0.0, x, y, math.cos(angle), math.sin(angle)


@njit(cache=True)
def _split(places, sums, sigma, price, most_turn, sagitta):  # pragma: no cover - compiled
    """The last places of the curves of the cheapest row, and its cost; `places` [m + 1, 2] has the end too."""
    m = len(sums)
    cost, before = np.full(m + 1, np.inf), np.zeros(m + 1, np.int64)
    cost[0] = 0.0
    totals, bounds, live, count = np.zeros((m, 9)), np.empty(m), np.empty(m, np.int64), 0
    for j in range(1, m + 1):
        live[count] = j - 1
        count += 1
        for k in range(count):
            i = live[k]
            totals[i] += sums[j - 1]
            ux, uy = places[j, 0] - places[i, 0], places[j, 1] - places[i, 1]
            c, least = _choose(totals[i], ux, uy, price, sigma, most_turn, sagitta)[:2]
            # of a short piece more than the least may be left, and less of a longer one
            bounds[k] = cost[i] + least if ux * ux + uy * uy >= (SHORT * sigma) ** 2 else -np.inf
            if cost[i] + c < cost[j]:
                cost[j], before[j] = cost[i] + c, i
        # what is left of a piece only grows with it: from such a place none goes on that one from here would not beat (Killick 2012)
        kept = 0
        for k in range(count):
            if bounds[k] < cost[j] + BEHIND * price:
                live[kept] = live[k]
                kept += 1
        count = kept
    ends = [m]
    while before[ends[-1]] > 0:
        ends.append(before[ends[-1]])
    return np.array(ends)[::-1].copy(), cost[m]
