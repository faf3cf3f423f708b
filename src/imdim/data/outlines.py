"""The simple outlines of a batch of programs: rounded rectangles and slots, regular polygons, L, T and U, in four quarter turns.

A `form` says which outline and how it is turned, three `shares` of its box how it is shaped. A slot is a rectangle as round as it can be.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import torch
from torch import Tensor

from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, Ring, circle

MOST_CORNERS = 8
QUARTERS = 4
SHARES = 3
SHARP = 1e-6  # of half a side: a corner less round is none
NEAR = 0.02  # of half of its box, by which the corners of an outline may be off those of a form


class Family(IntEnum):
    """`shares` of the box: ROUNDED the corner's radius by half of the shorter side; ELL the thickness of the wall at -x and of the floor at
    -y; TEE the thickness of the stem and of the bar at -y; CHANNEL (U, open to +y) the thickness of each wall and of the floor; polygons
    none, their box is twice the radius on which their corners lie. The third is the inner radius of what is turned, by its outer one."""

    ROUNDED = 0
    TRIANGLE = 1
    PENTAGON = 2
    HEXAGON = 3
    OCTAGON = 4
    ELL = 5
    TEE = 6
    CHANNEL = 7


NO_FORM = 0
FORMS = 1 + len(Family) * QUARTERS
SIDES = {Family.TRIANGLE: 3, Family.PENTAGON: 5, Family.HEXAGON: 6, Family.OCTAGON: 8}
# how many quarter turns of an outline differ, and how many of its two shares it has
TURNS_OF = {Family.ROUNDED: 1, Family.HEXAGON: 2, Family.OCTAGON: 1}
SHARES_OF = {Family.ROUNDED: 1, Family.ELL: 2, Family.TEE: 2, Family.CHANNEL: 2}


def form_of(family: Tensor, quarter: Tensor) -> Tensor:
    """The forms [...] of families [...] turned by quarters [...], any whole numbers: the same for the same outline."""
    turns = _table([TURNS_OF.get(f, QUARTERS) for f in Family], family)[family]
    return 1 + family * QUARTERS + quarter % turns


def family_of(form: Tensor) -> Tensor:
    """Families [...] of forms [...]; any where there is none."""
    return (form - 1).clamp_min(0) // QUARTERS


def quarter_of(form: Tensor) -> Tensor:
    """Quarter turns [...] of forms [...]."""
    return (form - 1).clamp_min(0) % QUARTERS


def mask_shares(form: Tensor, turned: Tensor) -> Tensor:
    """Which shares [..., 3] mean something for forms [...], of which some are `turned` about an axis."""
    own = _table([SHARES_OF.get(f, 0) for f in Family], form)[family_of(form)] * (form != NO_FORM)
    first = own[..., None] > torch.arange(2, device=form.device)
    return torch.cat([first, (turned & (form != NO_FORM))[..., None]], -1)


def mirror(form: Tensor, shares: Tensor) -> tuple[Tensor, Tensor]:
    """Forms [...] and shares [..., 3] of the images in the x axis."""
    family, quarter = family_of(form), quarter_of(form)
    ell, polygon = family == Family.ELL, (family >= Family.TRIANGLE) & (family <= Family.OCTAGON)
    turned = torch.where(ell, 3 - quarter, torch.where(polygon, -quarter, 2 - quarter))
    swapped = torch.where(ell[..., None], shares[..., [1, 0, 2]], shares)
    return torch.where(form == NO_FORM, form, form_of(family, turned)), swapped


def turn(form: Tensor, quarters: Tensor) -> Tensor:
    """Forms [...] turned by `quarters` [...] counter-clockwise."""
    return torch.where(form == NO_FORM, form, form_of(family_of(form), quarter_of(form) + quarters))


def corners(form: Tensor, shares: Tensor, half: Tensor) -> Tensor:
    """Corners [..., 8, 2], counter-clockwise, of outlines in boxes of half edges `half` [..., 2] about the origin, before they are rounded;
    the last one repeats where there are fewer."""
    family, quarter = family_of(form), quarter_of(form)
    odd = (quarter % 2 == 1)[..., None]
    w, h = torch.where(odd, half.flip(-1), half).unbind(-1)
    a, b = shares[..., 0] * 2, shares[..., 1] * 2 * h - h
    stem, wall, inner = a / 2 * w, a * w - w, w - a * w
    shapes = {
        Family.ROUNDED: [(-w, -h), (w, -h), (w, h), (-w, h)],
        Family.ELL: [(-w, -h), (w, -h), (w, b), (wall, b), (wall, h), (-w, h)],
        Family.TEE: [(-w, -h), (w, -h), (w, b), (stem, b), (stem, h), (-stem, h), (-stem, b), (-w, b)],
        Family.CHANNEL: [(-w, -h), (w, -h), (w, h), (inner, h), (inner, b), (-inner, b), (-inner, h), (-w, h)],
    }
    for polygon, n in SIDES.items():
        angles = [_first_angle(n) + 2 * math.pi * k / n for k in range(n)]
        shapes[polygon] = [(half[..., 0] * math.cos(t), half[..., 0] * math.sin(t)) for t in angles]
    each = [torch.stack([torch.stack(p, -1) for p in _filled(shapes[f])], -2) for f in Family]
    places = torch.zeros_like(each[0])
    for f, made in zip(Family, each, strict=True):
        places = torch.where((family == f)[..., None, None], made, places)
    return _rotate(places, quarter[..., None])


def rounding(form: Tensor, shares: Tensor, half: Tensor) -> Tensor:
    """Radii [...] of the corners of outlines in boxes of half edges `half` [..., 2]."""
    return torch.where(family_of(form) == Family.ROUNDED, shares[..., 0] * half.amin(-1), 0.0)


def outline_levels(form: Tensor, shares: Tensor, half: Tensor, u: Tensor, v: Tensor, to_axis: Tensor) -> Tensor:
    """Negative inside outlines [m], at points `u`, `v` [m, n]: the largest violated bound. What touches an axis at -x (`to_axis` [m]) goes
    on beyond it: on the axis of a turned solid there is no surface."""
    family, quarter = family_of(form), quarter_of(form)
    r = rounding(form, shares, half)[:, None]
    x, y = u.abs() - (half[:, :1] - r), v.abs() - (half[:, 1:] - r)
    level = torch.hypot(x.clamp_min(0), y.clamp_min(0)) + torch.maximum(x, y).clamp_max(0) - r
    level = torch.where((family >= Family.ELL)[:, None], _bar_levels(family, quarter, shares, half, u, v, to_axis), level)
    n = _table([float(SIDES.get(f, 4)) for f in Family], shares)[family][:, None]
    first = _table([_first_angle(SIDES.get(f, 4)) for f in Family], shares)[family][:, None] + quarter[:, None] * (math.pi / 2)
    sector = 2 * math.pi / n
    angle = torch.remainder(torch.atan2(v, u) - first, sector) - sector / 2
    polygon = torch.hypot(u, v) * torch.cos(angle) - half[:, :1] * torch.cos(sector / 2)
    is_polygon = (family >= Family.TRIANGLE) & (family <= Family.OCTAGON)
    return torch.where(is_polygon[:, None], polygon, level)


def _bar_levels(family: Tensor, quarter: Tensor, shares: Tensor, half: Tensor, u: Tensor, v: Tensor, to_axis: Tensor) -> Tensor:
    """Of L, T and U: unions of bars that overlap, so that there is no surface between them."""
    w, h = torch.where((quarter % 2 == 1)[:, None], half.flip(-1), half).unbind(-1)
    a, b = shares[:, 0], shares[:, 1]
    tee = family == Family.TEE
    first = torch.where(tee, -a * w, -w), torch.where(tee, a * w, 2 * a * w - w)
    # the second wall of a U; of others the same again
    channel = family == Family.CHANNEL
    second = torch.where(channel, w - 2 * a * w, first[0]), torch.where(channel, w, first[1])
    level = torch.full_like(u, torch.inf)
    for x0, x1, y1 in ((*first, h), (*second, h), (-w, w, 2 * b * h - h)):
        ends = _rotate(torch.stack([torch.stack([x0, -h], -1), torch.stack([x1, y1], -1)], 1), quarter[:, None])
        low, high = ends.amin(1), ends.amax(1)
        beyond = torch.where(to_axis & (low[:, 0] <= -half[:, 0] * (1 - SHARP)), 4 * half[:, 0], 0.0)
        x = torch.maximum(low[:, :1] - beyond[:, None] - u, u - high[:, :1])
        level = torch.minimum(level, torch.maximum(x, torch.maximum(low[:, 1:] - v, v - high[:, 1:])))
    return level


class Measures(NamedTuple):
    """Of outlines: areas, perimeters, and x of the centroids of both, [...]."""

    area: Tensor
    around: Tensor
    middle: Tensor
    middle_of_edge: Tensor


def measure_outlines(at: Tensor, r: Tensor) -> Measures:
    """Of outlines with corners `at` [..., 8, 2], of radius `r` [...]; those that are round are about the origin."""
    x, y = at.unbind(-1)
    cross = x * y.roll(-1, -1) - x.roll(-1, -1) * y
    area = cross.sum(-1) / 2
    length = torch.linalg.vector_norm(at - at.roll(-1, -2), dim=-1)
    middle = ((x + x.roll(-1, -1)) * cross).sum(-1) / (6 * area).clamp_min(1e-12)
    of_edge = (length * (x + x.roll(-1, -1))).sum(-1) / (2 * length.sum(-1)).clamp_min(1e-12)
    return Measures(area - (4 - math.pi) * r * r, length.sum(-1) - (8 - 2 * math.pi) * r, middle, of_edge)


def on_outlines(at: Tensor, r: Tensor, half: Tensor, pick: Tensor, bend: Tensor) -> tuple[Tensor, Tensor]:
    """Points and outward normals [..., 2] on outlines with corners `at` [..., 8, 2], of radius `r` [...], in boxes of half edges `half`
    [..., 2]: evenly for even `pick` and `bend` [...] of 0 to 1."""
    side = at.roll(-1, -2) - at
    length = torch.linalg.vector_norm(side, dim=-1)
    there = length > 1e-12
    straight = (length - 2 * r[..., None]).clamp_min(0.0) * there
    ends = torch.cat([straight, 2 * math.pi * r[..., None]], -1).cumsum(-1)
    place = pick[..., None] * ends[..., -1:]
    which = (ends[..., :-1] <= place).sum(-1, keepdim=True).clamp_max(MOST_CORNERS)
    edge = which.clamp_max(MOST_CORNERS - 1)[..., None]
    from_start = (place - torch.cat([torch.zeros_like(ends[..., :1]), ends], -1).gather(-1, which))[..., 0] + r
    along = side.gather(-2, edge.expand(*edge.shape[:-1], 2))[..., 0, :]
    along = along / torch.linalg.vector_norm(along, dim=-1, keepdim=True).clamp_min(1e-12)
    begin = at.gather(-2, edge.expand(*edge.shape[:-1], 2))[..., 0, :]
    angle = 2 * math.pi * bend
    out = torch.stack([torch.cos(angle), torch.sin(angle)], -1)
    arc = out.sign() * (half - r[..., None]) + out * r[..., None]
    is_arc = which == MOST_CORNERS
    normal = torch.stack([along[..., 1], -along[..., 0]], -1)
    return torch.where(is_arc, arc, begin + along * from_start[..., None]), torch.where(is_arc, out, normal)


def to_outline(form: int, shares: tuple[float, ...], half: tuple[float, float], beside: float = 0.0) -> Outline:
    """One outline, moved by `beside` along x: what is turned lies beside its axis."""
    of = torch.tensor(form), torch.tensor(shares, dtype=torch.float64), torch.tensor(half, dtype=torch.float64)
    at, r = list(dict.fromkeys(map(tuple, corners(*of).tolist()))), float(rounding(*of))
    if r <= SHARP * min(half):
        return Outline((tuple((x + beside, y, 0.0) for x, y in at),))
    if r >= min(half) * (1 - SHARP):
        return Outline((_stadium(half, beside),))
    bulge = math.tan(math.pi / 8)
    ring = []
    for (x, y), (px, py), (nx, ny) in zip(at, [at[-1], *at[:-1]], [*at[1:], at[0]], strict=True):
        before, after = (((qx > x) - (qx < x), (qy > y) - (qy < y)) for qx, qy in ((px, py), (nx, ny)))
        ring += [(x + r * before[0] + beside, y + r * before[1], bulge), (x + r * after[0] + beside, y + r * after[1], 0.0)]
    return Outline((tuple(ring),))


def _stadium(half: tuple[float, float], beside: float) -> Ring:
    """Two half circles, with lines between them where the box is longer than wide."""
    (w, h), r = half, min(half)
    a, b = w - r, h - r
    if max(a, b) <= SHARP * r:
        return circle(r, beside)
    if a > 0:
        return ((beside - a, -r, 0.0), (beside + a, -r, 1.0), (beside + a, r, 0.0), (beside - a, r, 1.0))
    return ((beside + r, -b, 0.0), (beside + r, b, 1.0), (beside - r, b, 0.0), (beside - r, -b, 1.0))


def _first_angle(n: int) -> float:
    """Of a corner: a polygon of eight sides stands on one, others have a corner on +x."""
    return math.pi / 8 if n == 8 else 0.0


def _rotate(points: Tensor, quarter: Tensor) -> Tensor:
    """Points [..., 2] turned by quarters [...] counter-clockwise."""
    x, y = points.unbind(-1)
    ways = torch.stack([torch.stack(p, -1) for p in ((x, y), (-y, x), (-x, -y), (y, -x))], -2)
    index = (quarter % QUARTERS).expand(x.shape)[..., None, None].expand(*x.shape, 1, 2)
    return ways.gather(-2, index)[..., 0, :]


def _filled(points: list[tuple[Tensor, Tensor]]) -> list[tuple[Tensor, Tensor]]:
    return points + points[-1:] * (MOST_CORNERS - len(points))


def _table(values: list, like: Tensor) -> Tensor:
    return torch.tensor(values, device=like.device)


def from_outline(outline: Outline) -> tuple[int, tuple[float, float, float], tuple[float, float], tuple[float, float]] | None:
    """Form, shares, half edges of the box and its middle of a simple outline; None of any other. The share that only what is turned has
    is not told."""
    (x0, y0), (x1, y1) = outline.bounds
    half, middle = ((x1 - x0) / 2, (y1 - y0) / 2), ((x0 + x1) / 2, (y0 + y1) / 2)
    if len(outline.loops) != 1 or isinstance(outline.loops[0], Ellipse) or min(half) <= 0:
        return None
    ring = [(x - middle[0], y - middle[1], b) for x, y, b in outline.loops[0]]
    found = _as_rounded(ring, half) if any(b for _, _, b in ring) else _as_bars(ring, half)
    if found is not None:
        return (*found, half, middle)
    at = _as_polygon(outline)
    return None if at is None else (at[0], (0.0, 0.0, 0.0), (at[1], at[1]), at[2])


def _as_rounded(ring: list[tuple[float, float, float]], half: tuple[float, float]) -> tuple[int, tuple[float, float, float]] | None:
    """A rectangle whose corners are all as round, from the ends of its quarter arcs, or of the half ones of a slot."""
    form = int(form_of(torch.tensor(int(Family.ROUNDED)), torch.tensor(0)))
    ends = zip(ring, [*ring[1:], ring[0]], strict=True)
    arcs = [math.hypot(x - u, y - v) / (2 * math.sin(2 * math.atan(abs(b)))) for (x, y, b), (u, v, _) in ends if b]
    r = sum(arcs) / len(arcs)
    share = r / min(half) if r < min(half) * (1 - NEAR) else 1.0
    return (form, (share, 0.0, 0.0)) if _is_near(ring, form, (share, 0.0, 0.0), half) else None


def _as_bars(ring: list[tuple[float, float, float]], half: tuple[float, float]) -> tuple[int, tuple[float, float, float]] | None:
    """A rectangle, or an L, T or U by where its inner corners are."""
    sharp = int(form_of(torch.tensor(int(Family.ROUNDED)), torch.tensor(0))), (0.0, 0.0, 0.0)
    if _is_near(ring, *sharp, half):
        return sharp
    inner = [(x, y) for x, y, _ in ring if abs(x) < half[0] * (1 - NEAR) and abs(y) < half[1] * (1 - NEAR)]
    for family in (Family.ELL, Family.TEE, Family.CHANNEL):
        for quarter in range(QUARTERS):
            w, h = half if quarter % 2 == 0 else half[::-1]
            back = [_quarter_turn(p, -quarter) for p in inner]
            if len(back) != (1 if family == Family.ELL else 2):
                continue
            x, y = max(abs(p[0]) for p in back), back[0][1]
            first = (back[0][0] + w) / (2 * w) if family == Family.ELL else x / w if family == Family.TEE else (w - x) / (2 * w)
            shares = first, (y + h) / (2 * h), 0.0
            form = int(form_of(torch.tensor(int(family)), torch.tensor(quarter)))
            if _is_near(ring, form, shares, half):
                return form, shares
    return None


def _as_polygon(outline: Outline) -> tuple[int, float, tuple[float, float]] | None:
    """A regular polygon that stands as a form does: its form, the radius of its corners and its middle."""
    ring = [(x, y) for x, y, b in outline.rings[0] if not b]
    if len(ring) != len(outline.rings[0]) or len(ring) not in SIDES.values():
        return None
    family = next(f for f, n in SIDES.items() if n == len(ring))
    middle = sum(x for x, _ in ring) / len(ring), sum(y for _, y in ring) / len(ring)
    moved = [(x - middle[0], y - middle[1], 0.0) for x, y in ring]
    radius = sum(math.hypot(x, y) for x, y, _ in moved) / len(ring)
    forms = (int(form_of(torch.tensor(int(family)), torch.tensor(quarter))) for quarter in range(TURNS_OF.get(family, QUARTERS)))
    return next(((form, radius, middle) for form in forms if _is_near(moved, form, (0.0, 0.0, 0.0), (radius, radius))), None)


def _is_near(ring: list[tuple[float, float, float]], form: int, shares: tuple[float, float, float], half: tuple[float, float]) -> bool:
    """Whether the corners of a ring about the origin are those of a form, within NEAR of its box."""
    made = to_outline(form, shares, half).rings[0]
    reach = NEAR * max(half)
    return len(made) == len(ring) and all(min(math.dist(v[:2], w[:2]) for w in made) < reach for v in ring)


def _quarter_turn(point: tuple[float, float], quarter: int) -> tuple[float, float]:
    x, y = point
    return ((x, y), (-y, x), (-x, -y), (y, -x))[quarter % QUARTERS]
