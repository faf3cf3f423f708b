"""Designs of the corpus that are drawn: frames, bent sheets and profiles; functions of a designer's choices, in millimetres."""

from __future__ import annotations

import math

from features import (
    BEYOND,
    UPRIGHT,
    Draw,
    bend,
    block,
    cut,
    extrusion,
    four,
    hexagon,
    ring,
    rod,
    round_off,
    rounded,
    slot,
    stand,
    through,
    turned,
    unite,
    window,
    wrap,
)

from imdim.program.outline import Loop
from imdim.program.tree import Program


def frame(draw: Draw) -> Program:
    """A plate with a large window, mostly with round corners, and screw holes in its rim."""
    w, d, t, rim = draw.length(50, 120), draw.length(40, 90), draw.length(3, 10), draw.length(9, 14)
    hole, _ = draw.screw()
    x, y, r = w - 2 * rim, d - 2 * rim, draw.length(2, 5)
    cuts = [through(hole, (u, v, 0), t) for u, v in four((w - rim) / 2, (d - rim) / 2)]
    if draw.coin(0.6):
        body: Program = extrusion([rounded(w, d, r + draw.length(0, 3))], (0, 0, t / 2), t)
        return cut(body, extrusion([rounded(x, y, r)], (0, 0, t / 2), t + 2 * BEYOND), *cuts)
    if draw.coin(0.4):
        return cut(extrusion([rounded(w, d, r), rounded(x, y, r)], (0, 0, t / 2), t), *cuts)
    return cut(stand(0, 0, 0, (w, d, t)), window(0, 0, 0, (x, y, t)), *cuts)


def oval_flange(draw: Draw) -> Program:
    """A plate about a bore that narrows to an ear with a hole on either side, sometimes with a pipe."""
    bore, t = draw.length(10, 30), draw.length(4, 10)
    hole, _ = draw.screw()
    big, ear = bore / 2 + draw.length(5, 9), hole / 2 + draw.length(3, 5)
    apart = big + ear + draw.length(1, 8)
    body: Program = extrusion([wrap([(apart, 0, ear), (0, 0, big), (-apart, 0, ear), (0, 0, big)])], (0, 0, t / 2), t)
    tall = t
    if draw.coin():
        tall = t + draw.length(8, 25)
        body = unite(body, rod(bore + draw.length(3, 6), (0, 0, 0), tall))
    return cut(body, through(bore, (0, 0, 0), tall), *(through(hole, (s * apart, 0, 0), t) for s in (1, -1)))


def triangle_plate(draw: Draw) -> Program:
    """A plate with three round corners and a hole in each."""
    t, around = draw.length(3, 8), draw.length(20, 50)
    hole, head = draw.screw()
    r = head / 2 + draw.length(1, 4)
    places = [(around * math.cos(a), around * math.sin(a)) for a in (math.pi / 2, math.pi * 7 / 6, math.pi * 11 / 6)]
    cuts = [through(hole, (x, y, 0), t) for x, y in places]
    if draw.coin():
        cuts.append(through(draw.length(6, around - r), (0, 0, 0), t))
    return cut(extrusion([wrap([(x, y, r) for x, y in places])], (0, 0, t / 2), t), *cuts)


def arm(draw: Draw) -> Program:
    """Two eyes of different sizes and the tapering web between them, sometimes thinner than the eyes."""
    apart, t = draw.length(40, 100), draw.length(4, 10)
    big, small = draw.length(10, 18), draw.length(6, 10)
    holes = [draw.length(5, 2 * big - 6), draw.length(3, 2 * small - 5)]
    outline = extrusion([wrap([(0, 0, big), (apart, 0, small)])], (0, 0, t / 2), t)
    tall = t
    body: Program = outline
    if draw.coin(0.4):
        tall = t + draw.length(2, 8)
        body = unite(outline, rod(2 * big, (0, 0, 0), tall))
    return cut(body, through(holes[0], (0, 0, 0), tall), through(holes[1], (apart, 0, 0), t))


def bent_sheet(draw: Draw) -> Program:
    """An L, a U, a Z or a hat of sheet metal, with holes."""
    t, inside, long = draw.length(1, 3), draw.length(1, 4), draw.length(15, 60)
    a, b, c = draw.length(15, 40), draw.length(15, 50), draw.length(15, 40)
    hole, _ = draw.screw()
    shape = draw.count(0, 3)
    cuts = [through(hole, (a / 2, 0, 0), t)] if long < 30 else [through(hole, (a / 2, s * long / 4, 0), t) for s in (1, -1)]
    if shape == 0:
        path = [(0, 0), (a + 8, 0), (a + 8, b)]
    elif shape == 1:
        path = [(0, b), (0, 0), (a, 0), (a, b)]
    elif shape == 2:
        path = [(0, 0), (a + 8, 0), (a + 8, b), (a + 8 + c, b)]
    else:
        path = [(0, 0), (a + 8, 0), (a + 8, b), (a + 8 + c, b), (a + 8 + c, 0), (2 * a + 16 + c, 0)]
    radii = inside if shape != 1 else min(inside, a / 2 - t - 1)
    body = extrusion([bend(path, t, radii)], (0, 0, 0), long, UPRIGHT)
    return cut(body, *cuts)


def nut_holder(draw: Draw) -> Program:
    """A block with holes that end in hexagonal pockets for nuts."""
    across = draw.length(5.5, 13)
    hole, deep = round(across * 0.6, 1), draw.length(2, 6)
    n, t = draw.count(1, 4), deep + draw.length(2, 8)
    pitch = across * 1.2 + draw.length(3, 8)
    places = [((i - (n - 1) / 2) * pitch, 0.0) for i in range(n)]
    body = stand(0, 0, 0, (n * pitch, across * 1.2 + draw.length(3, 8), t))
    pockets = [extrusion([hexagon(across)], (x, y, t - (deep - BEYOND) / 2), deep + BEYOND) for x, y in places]
    return cut(body, *pockets, *(through(hole, (x, y, 0), t) for x, y in places))


def dovetail_slide(draw: Draw) -> Program:
    """A block with a dovetail groove, or a rail that fits one, with holes."""
    long, w, neck, deep = draw.length(25, 70), draw.length(30, 60), draw.length(8, 14), draw.length(4, 8)
    h, lean = deep + draw.length(4, 10), draw.length(2, 4)
    hole, _ = draw.screw()
    if draw.coin():
        groove = ring(
            [
                (-neck / 2, h + BEYOND),
                (-neck / 2, h),
                (-neck / 2 - lean, h - deep),
                (neck / 2 + lean, h - deep),
                (neck / 2, h),
                (neck / 2, h + BEYOND),
            ]
        )
        body = cut(block((-w / 2, -long / 2, 0), (w, long, h)), extrusion([groove], (0, 0, 0), long + 2 * BEYOND, UPRIGHT))
        return cut(body, *(through(hole, (s * w / 2 * 0.75, 0, 0), h) for s in (1, -1)))
    tail = ring([(-neck / 2, h - deep), (neck / 2, h - deep), (neck / 2 + lean, h), (-neck / 2 - lean, h)])
    body = unite(block((-w / 2, -long / 2, 0), (w, long, h - deep)), extrusion([tail], (0, 0, 0), long, UPRIGHT))
    return cut(body, *(through(hole, (s * w / 2 * 0.7, 0, 0), h - deep) for s in (1, -1)))


def fan_plate(draw: Draw) -> Program:
    """A square plate with round corners, a large bore and four holes, sometimes with a collar about the bore."""
    w, t = float(draw.rng.choice([30, 40, 50, 60, 80])), draw.length(2, 6)
    bore, inset = w - draw.length(3, 6), draw.length(3, 5)
    cuts = [through(draw.length(3, 4.5), (x, y, 0), t) for x, y in four(w / 2 - inset, w / 2 - inset)]
    body: Program = extrusion([rounded(w, w, inset)], (0, 0, t / 2), t)
    if draw.coin(0.3):
        tall = t + draw.length(5, 15)
        body = unite(body, rod(bore + 2, (0, 0, 0), tall))
        return cut(body, through(bore - 2, (0, 0, 0), tall), *cuts)
    return cut(body, through(bore, (0, 0, 0), t), *cuts)


def spanner(draw: Draw) -> Program:
    """A handle with an open jaw at one end and a hole or a hexagon at the other."""
    across, t, long = draw.length(7, 17), draw.length(3, 7), draw.length(60, 120)
    head, wide = across * 1.1, draw.length(8, 12)
    handle = stand(long / 2, 0, 0, (long, wide, t))
    ends = [rod(2 * head, (0, 0, 0), t), rod(1.6 * head, (long, 0, 0), t)]
    jaw = window(-head, 0, 0, (2 * head, across, t))
    if draw.coin():
        return cut(unite(handle, *ends), jaw, extrusion([hexagon(0.75 * across)], (long, 0, t / 2), t + 2 * BEYOND))
    return cut(unite(handle, *ends), jaw, through(draw.length(4, head), (long, 0, 0), t))


def gusset(draw: Draw) -> Program:
    """An angle drawn from the side with a round inner corner and a slope, or two plates and a web, with holes."""
    w, h, t, long = draw.length(30, 70), draw.length(30, 70), draw.length(4, 8), draw.length(15, 40)
    hole, _ = draw.screw()
    if draw.coin():
        inner, tip = draw.length(3, 12), draw.length(1, t - 1)
        profile = round_off([(0, 0), (w, 0), (w, t), (t, t), (t, h), (0, h)], [0, 0, tip if draw.coin() else 0, inner, 0, 0])
    else:
        a, b = w - draw.length(10, 15), h - draw.length(10, 15)
        profile = ring([(0, 0), (w, 0), (w, t), (a, t), (t, b), (t, h), (0, h)])
    body = extrusion([profile], (0, 0, 0), long, UPRIGHT)
    return cut(body, through(hole, (w - 6, 0, 0), t), through(hole, (0, 0, h - 6), t, 0))


def channel(draw: Draw) -> Program:
    """A C with or without lips, and a row of slots in its back."""
    w, h, t, long = draw.length(20, 45), draw.length(15, 40), draw.length(1.5, 4), draw.length(40, 120)
    lip = draw.length(3, w / 4) if draw.coin() else 0.0
    half = w / 2
    side = [(half, h), (half - max(lip, t), h), (half - max(lip, t), h - t), (half - t, h - t)] if lip > t else [(half, h), (half - t, h)]
    profile = ring([(-half, 0), (half, 0), *side, (half - t, t), (t - half, t), *((-x, y) for x, y in reversed(side))])
    body = extrusion([profile], (0, 0, 0), long, UPRIGHT)
    n, pitch = draw.count(2, 5), long / 6
    hole: Loop = slot(draw.length(4, pitch - 5) if pitch > 9 else 2.0, draw.length(2, 4))
    return cut(body, *(extrusion([hole], (0, (i - (n - 1) / 2) * pitch, t / 2), t + 2 * BEYOND, (0, 0, 90)) for i in range(n)))


def wall_hook(draw: Draw) -> Program:
    """A J of one thickness, drawn from the side, with screw holes in its back."""
    t, wide, h = draw.length(4, 8), draw.length(10, 25), draw.length(40, 80)
    reach, r = draw.length(20, 40), draw.length(2, 8)
    r = min(r, reach / 2 - t - 1)
    lip = r + t + draw.length(3, 12)
    hole, _ = draw.screw()
    profile = bend([(0, h), (0, 0), (reach, 0), (reach, lip)], t, r)
    return cut(extrusion([profile], (0, 0, 0), wide, UPRIGHT), *(through(hole, (0, 0, z), t, 0) for z in (h - 8, h - 24)))


def strap_clamp(draw: Draw) -> Program:
    """Half a tube on two feet, drawn as it is seen from the end."""
    bore, t, long, foot = draw.length(10, 40), draw.length(2, 5), draw.length(8, 20), draw.length(12, 18)
    hole, _ = draw.screw()
    r, reach = bore / 2, bore / 2 + t + foot
    tall = (((r + t) ** 2) - t * t) ** 0.5
    if draw.coin():
        arc = math.tan((math.pi - 2 * math.asin(t / (r + t))) / 4)
        profile: Loop = (
            (-reach, 0, 0.0),
            (-r, 0, -1.0),
            (r, 0, 0.0),
            (reach, 0, 0.0),
            (reach, t, 0.0),
            (tall, t, arc),
            (-tall, t, 0.0),
            (-reach, t, 0.0),
        )
        body: Program = extrusion([profile], (0, 0, 0), long, UPRIGHT)
    else:
        whole = unite(rod(2 * (r + t), (0, -long / 2, 0), long, 1), block((-reach, -long / 2, 0), (2 * reach, long, t)))
        below = block((-reach - BEYOND, -long, -r - t - BEYOND), (2 * reach + 2 * BEYOND, 2 * long, r + t + BEYOND))
        body = cut(whole, through(bore, (0, -long / 2, 0), long, 1), below)
    return cut(body, *(through(hole, (s * (reach - foot / 2), 0, 0), t) for s in (1, -1)))


def keyhole_plate(draw: Draw) -> Program:
    """A plate to hang something from, with keyholes: a round hole and a narrower slot."""
    w, d, t = draw.length(40, 90), draw.length(25, 50), draw.length(2, 5)
    hole, head = draw.screw()
    drop = head / 2 + draw.length(3, 6)
    x = w / 2 - head
    body: Program = extrusion([rounded(w, d, draw.length(2, 6))], (0, 0, t / 2), t) if draw.coin() else stand(0, 0, 0, (w, d, t))
    cuts: list[Program] = []
    for s in (1, -1):
        cuts += [through(head, (s * x, -drop / 2, 0), t), extrusion([slot(drop, hole)], (s * x, 0, t / 2), t + 2 * BEYOND, (0, 0, 90))]
    return cut(body, *cuts)


def turned_handle(draw: Draw) -> Program:
    """A handle turned from a section with a waist, a collar or a round end, with a hole for a thread."""
    long, wide, neck = draw.length(30, 80), draw.length(8, 16), draw.length(5, 8)
    collar, bore = draw.length(2, 5), draw.length(2, neck - 1)
    if draw.coin():
        section = [(0, 0), (neck, 0), (neck, collar), (wide, collar + draw.length(3, 8)), (wide, long - 4), (wide - 4, long), (0, long)]
        body = turned(section)
    else:
        body = unite(rod(2 * neck, (0, 0, 0), long / 3), rod(2 * wide, (0, 0, long / 3), long * 2 / 3))
    return cut(body, rod(2 * bore, (0, 0, -BEYOND), long / 4 + BEYOND))


PROFILES = (
    frame, oval_flange, triangle_plate, arm, bent_sheet, nut_holder, dovetail_slide, fan_plate, spanner, gusset, channel, wall_hook,
    strap_clamp, keyhole_plate, turned_handle,
)  # fmt: skip
