"""The shapes people make, as signed sequences with random numbers: one function per family, all rows of a batch at once.

A family draws `Dice.n` rows in any units and pose; rows may hold steps that do nothing, which `synthesize` removes. Aligned and
touching faces are built in: bosses stand on plates, uprights are flush with edges, shafts meet end to end.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import torch
from torch import Tensor

from imdim.data.canonical import shortest_from_z
from imdim.data.dice import Dice
from imdim.data.outlines import NO_FORM, QUARTERS, Family, form_of
from imdim.data.solids import ABSENT, BOX, CONE, CYLINDER, EXTRUDE, REVOLVE, SPHERE, TORUS, Solids

Column = tuple[Tensor, bool | Tensor, Tensor, Tensor, Tensor, Tensor, Tensor, bool | Tensor]


def _part(
    dice: Dice,
    kind: int | Tensor,
    center: tuple[float | Tensor, float | Tensor, float | Tensor],
    size: tuple[float | Tensor, float | Tensor, float | Tensor],
    positive: bool | Tensor = True,
    where: Tensor | None = None,
    rotation: Tensor | None = None,
    form: Tensor | None = None,
    shares: tuple[float | Tensor, float | Tensor, float | Tensor] = (0.0, 0.0, 0.0),
    common: bool | Tensor = False,
) -> Column:
    """One column; `where` [n] says which rows have it. What is `common` is intersected with."""
    device = dice.generator.device
    kinds = torch.as_tensor(kind, device=device).expand(dice.n)
    kinds = kinds if where is None else torch.where(where, kinds, ABSENT)
    turn = torch.eye(3, device=device) if rotation is None else rotation
    forms = torch.zeros(dice.n, dtype=torch.long, device=device) if form is None else form
    placed = kinds, positive, _vector(dice, center), _vector(dice, size), turn.expand(dice.n, 3, 3)
    return *placed, forms, _vector(dice, shares), common


def _vector(dice: Dice, values: tuple[float | Tensor, ...]) -> Tensor:
    device = dice.generator.device
    return torch.stack([torch.as_tensor(v, dtype=torch.float32, device=device).expand(dice.n) for v in values], -1)


def _solids(dice: Dice, columns: list[Column]) -> Solids:
    device = dice.generator.device
    kinds, positive, centers, sizes, rotations, forms, shares, common = zip(*columns, strict=True)
    joint = torch.stack([torch.as_tensor(c, device=device).expand(dice.n) for c in common], 1)
    signs = torch.stack([torch.as_tensor(p, device=device).expand(dice.n) for p in positive], 1) & ~joint
    stacked = (torch.stack(c, 1) for c in (kinds, centers, sizes, rotations, forms, shares))
    kind, center, size, rotation, form, share = stacked
    return Solids(kind, signs, center, size, rotation, form, share, joint)


def _along_x(dice: Dice) -> Tensor:
    return shortest_from_z(torch.eye(3, device=dice.generator.device)[0])


def _about_z(angle: Tensor) -> Tensor:
    c, s, o = torch.cos(angle), torch.sin(angle), torch.zeros_like(angle)
    return torch.stack([torch.stack([c, -s, o], -1), torch.stack([s, c, o], -1), torch.stack([o, o, o + 1], -1)], -2)


def _round_or_square(dice: Dice, r: Tensor, h: Tensor, p_square: float) -> tuple[Tensor, tuple[Tensor, Tensor, Tensor]]:
    """Kind and size of a cylinder (r, h), or of the box of edges 2r, 2r, h."""
    square = dice.coin(p_square)
    kind = torch.where(square, BOX, CYLINDER)
    return kind, (torch.where(square, 2 * r, r), torch.where(square, 2 * r, h), torch.where(square, h, torch.zeros_like(h)))


def plate(dice: Dice) -> Solids:
    """A plate or disc with bosses that stand on it, corner holes, a bore through the boss and a slot from an edge."""
    w, d = dice.log_uniform(0.6, 2.0), dice.log_uniform(0.6, 2.0)
    h = dice.log_uniform(0.04, 0.5)
    least = torch.minimum(w, d)
    disc = dice.coin(0.25)
    w, d = torch.where(disc, least, w), torch.where(disc, least, d)
    base_size = (torch.where(disc, w / 2, w), torch.where(disc, h, d), torch.where(disc, 0.0, h))
    columns = [_part(dice, torch.where(disc, CYLINDER, BOX), (0.0, 0.0, 0.0), base_size)]
    r, tall = least * dice.uniform(0.12, 0.38), dice.log_uniform(0.1, 0.8)
    kind, size = _round_or_square(dice, r, tall, 0.3)
    x = torch.where(dice.coin(0.5), 0.0, (w / 2 - r) * dice.uniform(-0.9, 0.9))
    columns.append(_part(dice, kind, (x, 0.0, h / 2 + tall / 2), size, where=dice.coin(0.6)))
    inset = least * dice.uniform(0.1, 0.22)
    hole = inset * dice.uniform(0.25, 0.75)
    dx, dy = w / 2 - inset, d / 2 - inset
    dx, dy = torch.where(disc, dx * 0.7, dx), torch.where(disc, dy * 0.7, dy)
    four, two = dice.coin(0.45), dice.coin(0.4)
    for sx, sy in ((1, 1), (-1, -1), (1, -1), (-1, 1)):
        columns.append(_part(dice, CYLINDER, (sx * dx, sy * dy, 0.0), (hole, 2 * h, 0.0), False, four | two if sx == sy else four))
    bore = r * dice.uniform(0.3, 0.8)
    depth = torch.where(dice.coin(0.5), 2 * (h + tall), tall)
    columns.append(_part(dice, CYLINDER, (x, 0.0, h / 2 + tall - depth / 2 + 0.1 * tall), (bore, depth, 0.0), False, dice.coin(0.6)))
    slot = dice.uniform(0.1, 0.35)
    columns.append(_part(dice, BOX, (w / 2, 0.0, 0.0), (w * dice.uniform(0.2, 0.8), d * slot, 3 * h), False, dice.coin(0.25)))
    return _solids(dice, columns)


def bracket(dice: Dice) -> Solids:
    """A base with one or two uprights flush with its edges, a rib, a boss on the upright, and holes in both."""
    w, d, t = dice.log_uniform(0.7, 1.6), dice.log_uniform(0.3, 1.2), dice.log_uniform(0.05, 0.25)
    t2, tall = dice.log_uniform(0.05, 0.25), dice.log_uniform(0.3, 1.4)
    top, middle = t / 2 + tall, t / 2 + tall / 2
    across = _along_x(dice)
    columns = [_part(dice, BOX, (0.0, 0.0, 0.0), (w, d, t)), _part(dice, BOX, (t2 / 2 - w / 2, 0.0, middle), (t2, d, tall))]
    columns.append(_part(dice, BOX, (w / 2 - t2 / 2, 0.0, middle), (t2, d, tall), where=dice.coin(0.35)))
    rib, reach = d * dice.uniform(0.1, 0.3), w * dice.uniform(0.2, 0.6)
    columns.append(_part(dice, BOX, (t2 - w / 2 + reach / 2, 0.0, t / 2 + tall / 4), (reach, rib, tall / 2), where=dice.coin(0.2)))
    r = torch.minimum(d, tall) * dice.uniform(0.15, 0.45)
    z = top - r * dice.uniform(0.9, 1.6)
    boss = dice.coin(0.4)
    length = t2 * dice.uniform(1.5, 4.0)
    columns.append(_part(dice, CYLINDER, (length / 2 - w / 2, 0.0, z), (r, length, 0.0), where=boss, rotation=across))
    bore = r * dice.uniform(0.3, 0.8)
    columns.append(_part(dice, CYLINDER, (-w / 2, 0.0, z), (bore, 2 * length + 2 * t2, 0.0), False, dice.coin(0.7), across))
    y, x, hole = d * dice.uniform(0.2, 0.32), w * dice.uniform(0.1, 0.35), d * dice.uniform(0.05, 0.13)
    pair, one = dice.coin(0.5), dice.coin(0.3)
    columns.append(_part(dice, CYLINDER, (x, torch.where(pair, y, 0.0), 0.0), (hole, 2 * t, 0.0), False, pair | one))
    columns.append(_part(dice, CYLINDER, (x, -y, 0.0), (hole, 2 * t, 0.0), False, pair))
    return _solids(dice, columns)


def draw_turned_parts(dice: Dice) -> Solids:
    """Coaxial cylinders end to end, a ball or a flat at the end, an axial bore, a counterbore and a cross hole."""
    count = dice.integers(1, 5)
    z, least, columns = torch.zeros(dice.n, device=dice.generator.device), None, []
    for i in range(5):
        r, h, there = dice.log_uniform(0.15, 0.8), dice.log_uniform(0.06, 1.0), count > i
        columns.append(_part(dice, CYLINDER, (0.0, 0.0, z + h / 2), (r, h, 0.0), where=there))
        z = torch.where(there, z + h, z)
        least = r if least is None else torch.where(there, torch.minimum(least, r), least)
    assert least is not None
    ball = least * dice.uniform(0.9, 1.8)
    columns.append(_part(dice, SPHERE, (0.0, 0.0, z), (ball, 0.0, 0.0), where=dice.coin(0.2)))
    flat = dice.coin(0.2)
    columns.append(_part(dice, BOX, (least * 1.4, 0.0, z), (least, 4 * least, z * dice.uniform(0.3, 0.9)), False, flat))
    bore, deep = least * dice.uniform(0.2, 0.85), torch.where(dice.coin(0.6), 2.2, dice.uniform(0.3, 1.2)) * z
    columns.append(_part(dice, CYLINDER, (0.0, 0.0, 1.05 * z - deep / 2), (bore, deep, 0.0), False, dice.coin(0.6)))
    wide = bore + (least - bore) * dice.uniform(0.2, 0.8)
    columns.append(_part(dice, CYLINDER, (0.0, 0.0, z), (wide, z * dice.uniform(0.1, 0.5), 0.0), False, dice.coin(0.25)))
    cross = least * dice.uniform(0.15, 0.5)
    up = z * dice.uniform(0.1, 0.9)
    columns.append(_part(dice, CYLINDER, (0.0, 0.0, up), (cross, 4.0, 0.0), False, dice.coin(0.3), _along_x(dice)))
    return _solids(dice, columns)


def pattern(dice: Dice) -> Solids:
    """Equal pegs or holes in a ring or a row on a base, with a hub and a bore."""
    ring, holes = dice.coin(0.6), dice.coin(0.5)
    big, h = dice.uniform(0.5, 1.0), dice.log_uniform(0.05, 0.4)
    count = dice.integers(2, 8)
    square = ~ring | dice.coin(0.3)
    length = torch.where(ring, 2 * big, count * 0.4 * big)
    width = torch.where(ring, 2 * big, 0.8 * big)
    base = (torch.where(square, length, big), torch.where(square, width, h), torch.where(square, h, 0.0))
    columns = [_part(dice, torch.where(square, BOX, CYLINDER), (0.0, 0.0, 0.0), base)]
    orbit = big * dice.uniform(0.6, 0.78)
    r = torch.minimum(big * 0.16, orbit * torch.sin(math.pi / count)) * dice.uniform(0.3, 0.95)
    tall = torch.where(holes, 3 * h, h * dice.uniform(0.8, 3.0))
    kind, size = _round_or_square(dice, r, tall, 0.3)
    z = torch.where(holes, 0.0, h / 2 + tall / 2)
    for i in range(8):
        angle = 2 * math.pi * i / count
        x = torch.where(ring, orbit * torch.cos(angle), (i - (count - 1) / 2) * 0.4 * big)
        y = torch.where(ring, orbit * torch.sin(angle), 0.0)
        turn = _about_z(torch.where(ring, angle, 0.0))
        columns.append(_part(dice, kind, (x, y, z), size, ~holes, count > i, turn))
    hub, post, centre = big * dice.uniform(0.2, 0.42), dice.uniform(0.1, 0.6), ring & dice.coin(0.5)
    columns.append(_part(dice, CYLINDER, (0.0, 0.0, h / 2 + post / 2), (hub, post, 0.0), where=centre))
    bore = hub * dice.uniform(0.3, 0.8)
    columns.append(_part(dice, CYLINDER, (0.0, 0.0, 0.0), (bore, 4.0, 0.0), False, ring & dice.coin(0.5)))
    return _solids(dice, columns)


def shell(dice: Dice) -> Solids:
    """A hollow box, tube or ball, open at the top, with feet and windows."""
    w, d, h = dice.log_uniform(0.5, 1.5), dice.log_uniform(0.5, 1.5), dice.log_uniform(0.3, 1.5)
    kind = torch.tensor([BOX, BOX, CYLINDER, CYLINDER, SPHERE], device=dice.generator.device)[dice.integers(0, 4)]
    box, ball = kind == BOX, kind == SPHERE
    h = torch.where(ball, w, h)
    d = torch.where(box, d, w)
    wall = torch.minimum(torch.minimum(w, d), h) * dice.uniform(0.04, 0.2)
    outer = (torch.where(box, w, w / 2), torch.where(box, d, torch.where(ball, 0.0, h)), torch.where(box, h, 0.0))
    inner_h = torch.where(dice.coin(0.5), h, 1.5 * h)
    inner = (
        torch.where(box, w - 2 * wall, w / 2 - wall),
        torch.where(box, d - 2 * wall, torch.where(ball, 0.0, inner_h)),
        torch.where(box, inner_h, 0.0),
    )
    lift = torch.where(ball, 0.0, wall - h / 2 + inner_h / 2)
    columns = [_part(dice, kind, (0.0, 0.0, 0.0), outer)]
    foot, fx, fy = wall * dice.uniform(0.7, 1.5), w * 0.3, d * 0.3
    feet, step = dice.coin(0.2) & ~ball, h * dice.uniform(0.08, 0.3)
    for sx, sy in ((1, 1), (-1, -1), (1, -1), (-1, 1)):
        columns.append(_part(dice, CYLINDER, (sx * fx, sy * fy, -h / 2 - step / 2), (foot, step, 0.0), where=feet))
    columns.append(_part(dice, kind, (0.0, 0.0, lift), inner, False))
    open_at = h * dice.uniform(0.0, 0.35)
    columns.append(_part(dice, BOX, (0.0, 0.0, open_at + h), (2 * w, 2 * d, 2 * h), False, ball))
    r = torch.minimum(d, h) * dice.uniform(0.08, 0.25)
    columns.append(_part(dice, CYLINDER, (w / 2, 0.0, 0.0), (r, w * dice.uniform(0.5, 2.2), 0.0), False, dice.coin(0.4), _along_x(dice)))
    width = w * dice.uniform(0.1, 0.5)
    columns.append(_part(dice, BOX, (0.0, d / 2, h / 2), (width, d * 0.6, h * dice.uniform(0.3, 0.9)), False, dice.coin(0.3)))
    return _solids(dice, columns)


def free(dice: Dice) -> Solids:
    """One to eight signed primitives of any size, freely rotated or aligned, each centred within or at the skin of an earlier one."""
    count, aligned = dice.integers(1, 8), dice.coin(0.5)
    device = dice.generator.device
    identity = torch.eye(3, device=device)
    columns: list[Column] = []
    for i in range(8):
        kind = dice.integers(0, 2)
        spread = dice.log_uniform(0.08, 1.0, 3) * (1.0 if i == 0 else 0.8)
        flat = torch.where(kind[:, None] == BOX, spread, spread / 2)
        size = torch.stack([flat[:, 0], torch.where(kind == BOX, flat[:, 1], spread[:, 1]), flat[:, 2]], -1)
        size = torch.where((kind == SPHERE)[:, None], torch.nn.functional.pad(size[:, :1], (0, 2)), size)
        center = torch.zeros(dice.n, 3, device=device)
        if i > 0:
            near = dice.integers(0, i - 1)
            placed = torch.stack([c[2] for c in columns], 1)
            extents = torch.stack([c[3] for c in columns], 1)
            rows = torch.arange(dice.n, device=device)
            center = placed[rows, near] + extents[rows, near].clamp_min(0.1) * dice.uniform(-0.6, 0.6, 3)
        rotation = torch.where(aligned[:, None, None], identity, dice.rotations())
        positive = ~dice.coin(0.4) if i > 0 else torch.ones(dice.n, dtype=torch.bool, device=device)
        place, extent = center.unbind(-1), size.unbind(-1)
        columns.append(_part(dice, kind, (place[0], place[1], place[2]), (extent[0], extent[1], extent[2]), positive, count > i, rotation))
    return _solids(dice, columns)


def draw_funnels(dice: Dice) -> Solids:
    """Coaxial cylinders and cones end to end, a flange, and the same steps a wall further in, open at one end or both."""
    count, wall = dice.integers(1, 4), dice.log_uniform(0.03, 0.15)
    r, z = dice.log_uniform(0.2, 0.8), torch.zeros(dice.n, device=dice.generator.device)
    hollow, closed = dice.coin(0.75), dice.coin(0.35)
    outer: list[Column] = []
    inner: list[Column] = []
    for i in range(4):
        there, cone, h = count > i, dice.coin(0.55), dice.log_uniform(0.08, 0.9)
        end = torch.where(cone, dice.log_uniform(0.15, 0.8), r)
        kind = torch.where(cone, CONE, CYLINDER)
        outer.append(_part(dice, kind, (0.0, 0.0, z + h / 2), _size_turned(cone, r, end, h), where=there))
        # a floor at the closed end, and cylinders that leave at the open one, as people draw them
        floor = torch.where(closed, wall, -0.3 * h * ~cone) if i == 0 else torch.zeros_like(h)
        beyond = 0.3 * h * (~cone & (count == i + 1))
        low, high = z + floor, z + h + beyond
        fits = there & hollow & (torch.minimum(r, end) > 1.3 * wall) & (high > low + 0.02)
        start = r + (end - r) * floor.clamp_min(0.0) / h
        size = _size_turned(cone, (start - wall).clamp_min(0.01), (end - wall).clamp_min(0.01), (high - low).clamp_min(0.02))
        inner.append(_part(dice, kind, (0.0, 0.0, (low + high) / 2), size, False, fits))
        z = torch.where(there, z + h, z)
        # where a cylinder ends the next piece may have another radius
        step = torch.where(cone | dice.coin(0.3), end, dice.log_uniform(0.15, 0.8))
        r = torch.where(there, step, r)
    flange, thick = dice.coin(0.3), dice.log_uniform(0.03, 0.1)
    rim = outer[0][3][:, 0] * dice.uniform(1.1, 1.8)
    outer.append(_part(dice, CYLINDER, (0.0, 0.0, thick / 2), (rim, thick, 0.0), where=flange))
    window = dice.coin(0.15)
    cut = _part(dice, CYLINDER, (0.4, 0.0, z * dice.uniform(0.2, 0.8)), (0.1 * z.clamp_max(1.0), 1.0, 0.0), False, window, _along_x(dice))
    return _solids(dice, [*outer, *inner, cut])


def _size_turned(cone: Tensor, bottom: Tensor, top: Tensor, h: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Sizes of cones, and of cylinders of the bottom radius."""
    return bottom, torch.where(cone, top, h), torch.where(cone, h, 0.0)


def draw_knobs(dice: Dice) -> Solids:
    """A shank, a head that is a cylinder, a cone, a ball, an ellipsoid or a ring, a round groove, a foot, a bore and a flat."""
    r, h = dice.log_uniform(0.2, 0.7), dice.log_uniform(0.2, 1.2)
    head = torch.tensor([CYLINDER, CONE, SPHERE, SPHERE, TORUS], device=dice.generator.device)[dice.integers(0, 4)]
    oval = (head == SPHERE) & dice.coin(0.7)
    wide, tall = r * dice.uniform(0.8, 2.2), dice.log_uniform(0.1, 0.7)
    deep = torch.where(dice.coin(0.5), wide, wide * dice.uniform(0.5, 1.5))
    minor = torch.minimum(wide * 0.45, tall / 2 + 0.05)
    second = torch.where(head == CYLINDER, tall, torch.where(head == CONE, wide * dice.uniform(0.0, 1.5), torch.where(oval, deep, 0.0)))
    size = (wide, torch.where(head == TORUS, minor, second), torch.where((head == CONE) | oval, tall, 0.0))
    lifted = torch.where((head == CYLINDER) | (head == CONE), h + tall / 2, h)
    columns = [_part(dice, CYLINDER, (0.0, 0.0, h / 2), (r, h, 0.0)), _part(dice, head, (0.0, 0.0, lifted), size)]
    columns.append(_part(dice, CONE, (0.0, 0.0, -tall / 4), (r * dice.uniform(0.4, 1.8), r, tall / 2), where=dice.coin(0.35)))
    groove = r * dice.uniform(0.06, 0.3)
    columns.append(_part(dice, TORUS, (0.0, 0.0, h * dice.uniform(0.2, 0.7)), (r, groove, 0.0), False, dice.coin(0.3)))
    bore = r * dice.uniform(0.2, 0.7)
    columns.append(_part(dice, CYLINDER, (0.0, 0.0, h / 2), (bore, 4.0, 0.0), False, dice.coin(0.45)))
    flat = (r * dice.uniform(1.2, 1.7), 0.0, 0.0)
    columns.append(_part(dice, BOX, flat, (r, 4 * r, h * dice.uniform(0.5, 1.2)), False, dice.coin(0.2)))
    cross = r * dice.uniform(0.1, 0.4)
    columns.append(_part(dice, CYLINDER, (0.0, 0.0, h * dice.uniform(0.2, 0.6)), (cross, 4.0, 0.0), False, dice.coin(0.2), _along_x(dice)))
    return _solids(dice, columns)


def draw_vessels(dice: Dice) -> Solids:
    """An ellipsoid, hollow or solid, cut open or bored, with a foot and a handle."""
    a, c = dice.log_uniform(0.4, 1.0), dice.log_uniform(0.25, 1.0)
    b = torch.where(dice.coin(0.5), a, a * dice.uniform(0.5, 1.6))
    wall = torch.minimum(torch.minimum(a, b), c) * dice.uniform(0.06, 0.3)
    hollow, rim = dice.coin(0.6), c * dice.uniform(-0.2, 0.8)
    columns = [_part(dice, SPHERE, (0.0, 0.0, 0.0), (a, b, c))]
    foot = torch.minimum(a, b) * dice.uniform(0.3, 0.9)
    stand = _size_turned(dice.coin(0.6), foot * dice.uniform(0.6, 1.6), foot, c * dice.uniform(0.3, 0.8))
    standing = torch.where(stand[2] > 0, CONE, CYLINDER)
    columns.append(_part(dice, standing, (0.0, 0.0, -c), stand, where=dice.coin(0.5)))
    handle = c * dice.uniform(0.25, 0.5)
    across = _along_x(dice)
    turn = _about_z(torch.full((dice.n,), math.pi / 2, device=dice.generator.device)) @ across
    ring = (handle, handle * dice.uniform(0.12, 0.4), 0.0)
    columns.append(_part(dice, TORUS, (a, 0.0, 0.0), ring, where=dice.coin(0.35), rotation=turn))
    columns.append(_part(dice, SPHERE, (0.0, 0.0, 0.0), (a - wall, b - wall, c - wall), False, hollow))
    columns.append(_part(dice, BOX, (0.0, 0.0, rim + 2.0), (6.0, 6.0, 4.0), False, hollow | dice.coin(0.4)))
    bore = torch.minimum(a, b) * dice.uniform(0.1, 0.5)
    columns.append(_part(dice, CYLINDER, (0.0, 0.0, 0.0), (bore, 6.0, 0.0), False, ~hollow & dice.coin(0.6)))
    return _solids(dice, columns)


def draw_sunk_plates(dice: Dice) -> Solids:
    """A plate or disc, its edge or boss bevelled, with countersunk or counterbored holes and round or oval dishes."""
    w, d, h = dice.log_uniform(0.6, 2.0), dice.log_uniform(0.6, 2.0), dice.log_uniform(0.06, 0.4)
    disc = dice.coin(0.4)
    least = torch.minimum(w, d)
    w, d = torch.where(disc, least, w), torch.where(disc, least, d)
    base = (torch.where(disc, w / 2, w), torch.where(disc, h, d), torch.where(disc, 0.0, h))
    columns = [_part(dice, torch.where(disc, CYLINDER, BOX), (0.0, 0.0, 0.0), base)]
    bevel, steep = least / 2 * dice.uniform(0.6, 0.95), dice.log_uniform(0.03, 0.5)
    top = torch.where(disc & dice.coin(0.5), least / 2, least * dice.uniform(0.15, 0.4))
    columns.append(_part(dice, CONE, (0.0, 0.0, h / 2 + steep / 2), (top, torch.minimum(bevel, top * 0.95), steep), where=dice.coin(0.5)))
    inset = least * dice.uniform(0.14, 0.24)
    hole = inset * dice.uniform(0.2, 0.5)
    wide, sink = hole * dice.uniform(1.4, 2.2), torch.minimum(h * dice.uniform(0.3, 1.0), hole * dice.uniform(0.5, 1.5))
    bored = dice.coin(0.3)
    sunk = torch.where(bored, CYLINDER, CONE)
    deep = torch.where(bored, 2 * sink, wide)
    dx, dy = (w / 2 - inset) * torch.where(disc, 0.7, 1.0), (d / 2 - inset) * torch.where(disc, 0.7, 1.0)
    four, two = dice.coin(0.3), dice.coin(0.5)
    for sx, sy in ((1, 1), (-1, -1), (1, -1), (-1, 1)):
        where = four | two if sx == sy else four
        columns.append(_part(dice, CYLINDER, (sx * dx, sy * dy, 0.0), (hole, 3 * h, 0.0), False, where))
        height = torch.where(bored, h / 2, h / 2 - sink / 2)
        columns.append(
            _part(
                dice, sunk, (sx * dx, sy * dy, height), (torch.where(bored, wide, hole), deep, torch.where(bored, 0.0, sink)), False, where
            )
        )
    centre = least * dice.uniform(0.08, 0.2)
    dish = dice.coin(0.5)
    size = (centre, torch.where(dish, centre * dice.uniform(0.6, 1.6), 6.0), torch.where(dish, h * dice.uniform(0.4, 0.9), 0.0))
    place = torch.where(dish, h / 2, 0.0)
    columns.append(_part(dice, torch.where(dish, SPHERE, CYLINDER), (0.0, 0.0, place), size, False, dice.coin(0.4)))
    return _solids(dice, columns)


def draw_mixtures(dice: Dice) -> Solids:
    """One to six signed primitives of all six kinds, mostly aligned, each centred within or at the skin of an earlier one."""
    count, aligned = dice.integers(1, 6), dice.coin(0.8)
    device = dice.generator.device
    turns = torch.stack([torch.eye(3, device=device), _along_x(Dice(dice.generator, 1)), shortest_from_z(torch.eye(3, device=device)[1])])
    columns: list[Column] = []
    for i in range(6):
        kind = torch.tensor([BOX, SPHERE, SPHERE, CYLINDER, CONE, CONE, TORUS, TORUS], device=device)[dice.integers(0, 7)]
        ball = dice.coin(0.4)
        a, b, c = (dice.log_uniform(0.08, 1.0, 3) * (1.0 if i == 0 else 0.8)).unbind(-1)
        a = torch.where(kind == BOX, a, a / 2)
        second = torch.where(kind == BOX, b, b / 2)
        second = torch.where(kind == CYLINDER, b, second)
        second = torch.where(kind == TORUS, a * dice.uniform(0.15, 0.8), second)
        second = torch.where(kind == CONE, torch.where(dice.coin(0.25), 0.0, a * dice.uniform(0.2, 1.6)), second)
        second = torch.where((kind == SPHERE) & ball, 0.0, second)
        third = torch.where((kind == BOX) | (kind == CONE), c, torch.where((kind == SPHERE) & ~ball, c / 2, 0.0))
        size = torch.stack([a, second, third], -1)
        center = torch.zeros(dice.n, 3, device=device)
        if i > 0:
            near = dice.integers(0, i - 1)
            placed = torch.stack([p[2] for p in columns], 1)
            extents = torch.stack([p[3] for p in columns], 1)
            rows = torch.arange(dice.n, device=device)
            center = placed[rows, near] + extents[rows, near].clamp_min(0.1) * dice.uniform(-0.6, 0.6, 3)
            # what shares an axis is common
            center = torch.where(dice.coin(0.35, 3), placed[rows, near], center)
        rotation = torch.where(aligned[:, None, None], turns[dice.integers(0, 2)], dice.rotations())
        positive = ~dice.coin(0.4) if i > 0 else torch.ones(dice.n, dtype=torch.bool, device=device)
        place, extent = center.unbind(-1), size.unbind(-1)
        columns.append(_part(dice, kind, (place[0], place[1], place[2]), (extent[0], extent[1], extent[2]), positive, count > i, rotation))
    return _solids(dice, columns)


EXTRUDED = (Family.ROUNDED, Family.ROUNDED, Family.ELL, Family.TEE, Family.CHANNEL)
EXTRUDED += (Family.TRIANGLE, Family.PENTAGON, Family.HEXAGON, Family.OCTAGON)
TURNED = (Family.ELL, Family.ELL, Family.TEE, Family.CHANNEL, Family.ROUNDED)


def _draw_form(dice: Dice, families: tuple[Family, ...], p_slot: float) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """A family, its form in a random quarter turn, and the first two shares."""
    device = dice.generator.device
    family = torch.tensor(families, device=device)[dice.integers(0, len(families) - 1)]
    form = form_of(family, dice.integers(0, QUARTERS - 1))
    thick = torch.where(family == Family.CHANNEL, dice.log_uniform(0.05, 0.35), dice.log_uniform(0.08, 0.6))
    first = torch.where(family == Family.ROUNDED, torch.where(dice.coin(p_slot), 1.0, dice.uniform(0.15, 0.9)), thick)
    return family, form, first, dice.log_uniform(0.08, 0.6)


def _edges_of(family: Tensor, w: Tensor, d: Tensor) -> Tensor:
    """The second edge of an outline's box: a polygon's is the first."""
    return torch.where((family >= Family.TRIANGLE) & (family <= Family.OCTAGON), w, d)


def draw_profiles(dice: Dice) -> Solids:
    """An extruded outline, flat or long, with a boss or a second outline on it, a slot or a pocket of any outline, and holes along and
    across."""
    family, form, a, b = _draw_form(dice, EXTRUDED, 0.4)
    w, h = dice.log_uniform(0.4, 1.6), dice.log_uniform(0.06, 1.6)
    d = _edges_of(family, w, dice.log_uniform(0.3, 1.6))
    columns = [_part(dice, EXTRUDE, (0.0, 0.0, 0.0), (w, d, h), form=form, shares=(a, b, 0.0))]
    least = torch.minimum(w, d)
    other, second, c, e = _draw_form(dice, EXTRUDED, 0.5)
    wide, tall = least * dice.uniform(0.3, 0.9), dice.log_uniform(0.08, 0.8)
    size = (wide, _edges_of(other, wide, wide * dice.log_uniform(0.4, 2.0)), tall)
    x, y = w * dice.uniform(-0.25, 0.25), d * dice.uniform(-0.25, 0.25)
    x, y = torch.where(dice.coin(0.5), 0.0, x), torch.where(dice.coin(0.5), 0.0, y)
    columns.append(_part(dice, EXTRUDE, (x, y, h / 2 + tall / 2), size, True, dice.coin(0.25), form=second, shares=(c, e, 0.0)))
    boss = least * dice.uniform(0.15, 0.4)
    columns.append(_part(dice, CYLINDER, (x, y, h / 2 + tall / 2), (boss, tall, 0.0), True, dice.coin(0.2)))
    pocket, third, f, g = _draw_form(dice, EXTRUDED, 0.7)
    long = least * dice.uniform(0.15, 0.6)
    deep = torch.where(dice.coin(0.6), 3 * h + 2 * tall, h * dice.uniform(0.4, 1.2))
    hollow = (long, _edges_of(pocket, long, long * dice.log_uniform(0.3, 2.5)), deep)
    columns.append(_part(dice, EXTRUDE, (x, y, h / 2), hollow, False, dice.coin(0.4), form=third, shares=(f, g, 0.0)))
    hole = least * dice.uniform(0.04, 0.12)
    pair, px = dice.coin(0.5), w * dice.uniform(0.2, 0.42)
    py = torch.where(dice.coin(0.5), 0.0, d * dice.uniform(-0.4, 0.4))
    for sign in (1, -1):
        columns.append(_part(dice, CYLINDER, (sign * px, sign * py, 0.0), (hole, 3 * h, 0.0), False, pair))
    across = torch.minimum(h, least) * dice.uniform(0.1, 0.35)
    where, z = dice.coin(0.3), h * dice.uniform(-0.3, 0.3)
    columns.append(_part(dice, CYLINDER, (0.0, py * 0.5, z), (across, 3 * w, 0.0), False, where, _along_x(dice)))
    return _solids(dice, columns)


def draw_rings(dice: Dice) -> Solids:
    """A turned L, T, U or rounded outline (cups, hubs, pulleys, rings), with an axial bore, a flange or foot, holes in it and across it."""
    family, form, a, b = _draw_form(dice, TURNED, 0.2)
    r, h = dice.log_uniform(0.3, 1.0), dice.log_uniform(0.15, 1.6)
    inner = torch.where(dice.coin(0.5) & (family != Family.ROUNDED), 0.0, dice.uniform(0.15, 0.8))
    columns = [_part(dice, REVOLVE, (0.0, 0.0, 0.0), (r, h, 0.0), form=form, shares=(a, b, inner))]
    thick, rim = dice.log_uniform(0.04, 0.2), r * dice.uniform(1.1, 1.7)
    other, second, c, e = _draw_form(dice, EXTRUDED, 0.5)
    foot, plain = dice.coin(0.3), dice.coin(0.5)
    below = -h / 2 - thick / 2
    columns.append(_part(dice, CYLINDER, (0.0, 0.0, below), (rim, thick, 0.0), True, foot & plain))
    size = (2 * rim, _edges_of(other, 2 * rim, 2 * rim * dice.uniform(0.7, 1.4)), thick)
    columns.append(_part(dice, EXTRUDE, (0.0, 0.0, below), size, True, foot & ~plain, form=second, shares=(c, e, 0.0)))
    bore = r * dice.uniform(0.1, 0.6)
    columns.append(_part(dice, CYLINDER, (0.0, 0.0, 0.0), (bore, 4 * h + 4.0, 0.0), False, dice.coin(0.3)))
    hole, out = rim * dice.uniform(0.04, 0.1), rim * dice.uniform(0.6, 0.85)
    four, two = dice.coin(0.25), dice.coin(0.25)
    for sx, sy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        columns.append(_part(dice, CYLINDER, (sx * out, sy * out, below), (hole, 2 * h, 0.0), False, four | two if sx else four))
    z, across = h * dice.uniform(-0.3, 0.3), torch.minimum(r, h) * dice.uniform(0.08, 0.25)
    columns.append(_part(dice, CYLINDER, (r / 2, 0.0, z), (across, 2 * r, 0.0), False, dice.coin(0.25), _along_x(dice)))
    flat = r * dice.uniform(0.6, 0.95)
    columns.append(_part(dice, BOX, (r + flat, 0.0, z), (2 * r, 4 * r, h * dice.uniform(0.3, 1.5)), False, dice.coin(0.15)))
    return _solids(dice, columns)


def draw_common(dice: Dice) -> Solids:
    """What is common to two or three things: rounded blocks and knobs, lenses, shafts with flats, plates with bowed edges; bored."""
    device = dice.generator.device
    first = torch.tensor([BOX, CYLINDER, EXTRUDE, SPHERE], device=device)[dice.integers(0, 3)]
    family, form, a, b = _draw_form(dice, EXTRUDED, 0.3)
    w, d, h = dice.log_uniform(0.5, 1.5), dice.log_uniform(0.5, 1.5), dice.log_uniform(0.15, 1.5)
    d = torch.where(first == EXTRUDE, _edges_of(family, w, d), d)
    round_one = (first == CYLINDER) | (first == SPHERE)
    size = (
        torch.where(round_one, w / 2, w),
        torch.where(first == CYLINDER, h, torch.where(first == SPHERE, 0.0, d)),
        torch.where(round_one, 0.0, h),
    )
    columns = [_part(dice, first, (0.0, 0.0, 0.0), size, form=torch.where(first == EXTRUDE, form, NO_FORM), shares=(a, b, 0.0))]
    boss, tall = torch.minimum(w, d) * dice.uniform(0.15, 0.4), dice.log_uniform(0.1, 0.6)
    columns.append(_part(dice, CYLINDER, (0.0, 0.0, h / 2 + tall / 2), (boss, tall, 0.0), True, dice.coin(0.25)))
    spread = torch.sqrt(w * w + d * d) / 2
    for chance in (1.0, 0.3):
        kind = torch.tensor([SPHERE, CYLINDER, BOX, CONE, SPHERE], device=device)[dice.integers(0, 4)]
        r = spread * dice.uniform(0.7, 1.0)
        oval = (kind == SPHERE) & dice.coin(0.3)
        x, y, z = (torch.where(dice.coin(0.6), 0.0, spread * dice.uniform(-0.3, 0.3)) for _ in range(3))
        tapered = r * dice.uniform(0.5, 0.95)
        long = h + 2 * tall
        second = torch.where(
            kind == CYLINDER, 2 * long, torch.where(kind == CONE, tapered, torch.where(oval, r * dice.uniform(0.7, 1.3), d))
        )
        second = torch.where((kind == SPHERE) & ~oval, 0.0, second)
        third = torch.where(oval, r * dice.uniform(0.5, 1.0), torch.where(kind == SPHERE, 0.0, torch.where(kind == CONE, long, 2 * long)))
        leading = torch.where(kind == BOX, w * dice.uniform(0.5, 0.9), r)
        place = torch.where((kind == CONE) | (kind == BOX), 0.0, z)
        columns.append(
            _part(
                dice,
                kind,
                (x, y, place),
                (leading, second, torch.where(kind == CYLINDER, 0.0, third)),
                False,
                dice.coin(chance),
                common=True,
            )
        )
    bore = torch.minimum(w, d) * dice.uniform(0.06, 0.25)
    columns.append(_part(dice, CYLINDER, (0.0, 0.0, 0.0), (bore, 8.0, 0.0), False, dice.coin(0.4)))
    columns.append(
        _part(dice, CYLINDER, (0.0, 0.0, 0.0), (bore * dice.uniform(0.5, 1.0), 8.0, 0.0), False, dice.coin(0.25), _along_x(dice))
    )
    return _solids(dice, columns)


FAMILIES: Mapping[str, Callable[[Dice], Solids]] = {
    "plate": plate,
    "bracket": bracket,
    "turned": draw_turned_parts,
    "pattern": pattern,
    "shell": shell,
    "free": free,
    "funnel": draw_funnels,
    "knob": draw_knobs,
    "vessel": draw_vessels,
    "sunk": draw_sunk_plates,
    "mixture": draw_mixtures,
    "profile": draw_profiles,
    "ring": draw_rings,
    "common": draw_common,
}
# those that a `ShapeState` can say: united and cut primitives of the six kinds
PLAIN = tuple(name for name in FAMILIES if name not in ("profile", "ring", "common"))
