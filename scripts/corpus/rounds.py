"""Designs of the corpus that are round: functions of a designer's choices, in millimetres."""

from __future__ import annotations

from features import BEYOND, Draw, ball, blind, circle, cut, extrusion, four, hexagon, rod, stand, taper, through, turned, unite, window

from imdim.program.tree import Primitive, Program


def flange(draw: Draw) -> Program:
    """A disc with a hub, a bore and a circle of screw holes."""
    wide, t, hub = draw.length(50, 100), draw.length(5, 12), draw.length(20, 36)
    tall, bore, n = draw.length(8, 30), draw.length(8, hub - 6), draw.count(3, 8)
    hole, _ = draw.screw()
    middle = (wide + hub) / 4
    body = unite(rod(wide, (0, 0, 0), t), rod(hub, (0, 0, 0), t + tall))
    return cut(body, through(bore, (0, 0, 0), t + tall), *(through(hole, (x, y, 0), t) for x, y in circle(middle, n)))


def bushing(draw: Draw) -> Program:
    """A tube, often with a collar; drawn as a section or built of cylinders."""
    outer, long = draw.length(10, 40), draw.length(8, 40)
    bore, collar, t = draw.length(4, outer - 4), outer + draw.length(4, 12), draw.length(2, 5)
    flanged = draw.coin(0.6)
    if flanged and draw.coin(0.4):
        section = [(bore / 2, 0), (collar / 2, 0), (collar / 2, t), (outer / 2, t), (outer / 2, long + t), (bore / 2, long + t)]
        return turned(section)
    body = unite(rod(collar, (0, 0, 0), t), rod(outer, (0, 0, 0), long + t)) if flanged else rod(outer, (0, 0, 0), long + t)
    return cut(body, through(bore, (0, 0, 0), long + t))


def shaft(draw: Draw) -> Program:
    """Cylinders end to end, a chamfer, a flat or a cross hole."""
    n, z, parts = draw.count(2, 4), 0.0, list[Program]()
    widths = [draw.length(6, 30) for _ in range(n)]
    for wide in widths:
        long = draw.length(6, 40)
        parts.append(rod(wide, (0, 0, z), long))
        z += long
    if draw.coin(0.4):
        lead = draw.length(1, 2)
        parts.append(taper(widths[-1], widths[-1] - 2 * lead, (0, 0, z), lead))
        z += lead
    body = unite(*parts)
    if draw.coin(0.3):
        flat = draw.length(0.5, widths[0] / 6)
        return cut(body, window(widths[0] - flat, 0, 0, (widths[0], 2 * widths[0], 8)))
    return cut(body, through(draw.length(2, 3), (-20, 0, 4), 40, 0)) if draw.coin(0.3) else body


def knob(draw: Draw) -> Program:
    """A disc with grips about its rim, a hub, a bore and sometimes a recess."""
    wide, h, n = draw.length(25, 60), draw.length(8, 20), draw.count(5, 12)
    grip, bore = draw.length(4, 8), draw.length(4, 8)
    hub, low = bore + draw.length(4, 8), draw.length(3, 8)
    body = unite(rod(wide, (0, 0, low), h), rod(hub, (0, 0, 0), low))
    cuts: list[Program] = [through(grip, (x, y, low), h) for x, y in circle(wide / 2, n)]
    cuts.append(through(bore, (0, 0, 0), low + h) if draw.coin() else rod(bore, (0, 0, -BEYOND), low + h / 2 + BEYOND))
    if draw.coin(0.3):
        cuts.append(blind(wide - 12, (0, 0, low + h), draw.length(1, 3)))
    return cut(body, *cuts)


def standoff(draw: Draw) -> Program:
    """A round or hexagonal post with a hole from either end or through."""
    wide, long, bore = draw.length(5, 12), draw.length(6, 30), draw.length(2, 4)
    body: Program = extrusion([hexagon(wide)], (0, 0, long / 2), long) if draw.coin() else rod(wide, (0, 0, 0), long)
    if draw.coin(0.6):
        return cut(body, through(bore, (0, 0, 0), long))
    return cut(body, blind(bore, (0, 0, long), long / 3), rod(bore, (0, 0, -BEYOND), long / 3 + BEYOND))


def pulley(draw: Draw) -> Program:
    """Two rims and a groove between them, a bore, a hub with a cross hole; drawn as a section or built of cylinders and cones."""
    rim, t, groove, bore = draw.length(20, 50), draw.length(1.5, 3), draw.length(5, 12), draw.length(4, 8)
    inner, hub, long = rim - draw.length(4, 10), bore + draw.length(5, 8), draw.length(5, 10)
    top = 2 * t + groove
    if draw.coin(0.4):
        half = [
            (0, 0),
            (rim, 0),
            (rim, t),
            (inner, t + (rim - inner) / 4),
            (inner, top - t - (rim - inner) / 4),
            (rim, top - t),
            (rim, top),
            (0, top),
        ]
        body: Program = turned([(r / 2, z) for r, z in half])
    else:
        body = unite(rod(rim, (0, 0, 0), t), rod(inner, (0, 0, 0), top), rod(rim, (0, 0, top - t), t))
    body = unite(body, rod(hub, (0, 0, top), long))
    cuts: list[Program] = [through(bore, (0, 0, 0), top + long)]
    if draw.coin(0.5):
        cuts.append(rod(3.0, (0, 0, top + long / 2), hub, 0))
    return cut(body, *cuts)


def pillow_block(draw: Draw) -> Program:
    """A bearing's housing on a foot with two holes."""
    outer, bore, d = draw.length(24, 46), draw.length(8, 18), draw.length(12, 30)
    up, t, foot = outer / 2 + draw.length(2, 8), draw.length(5, 10), draw.length(14, 24)
    hole, _ = draw.screw()
    body: list[Program] = [stand(0, 0, 0, (outer + 2 * foot, d, t)), rod(outer, (0, -d / 2, up), d, 1)]
    body.append(stand(0, 0, 0, (outer, d, up)))
    cuts: list[Program] = [through(bore, (0, -d / 2, up), d, 1)]
    if draw.coin(0.4):
        cuts.append(rod(bore + 8, (0, d / 2 - 4, up), 4 + BEYOND, 1))
    return cut(unite(*body), *cuts, *(through(hole, (sx * (outer + foot) / 2, 0, 0), t) for sx in (1, -1)))


def funnel(draw: Draw) -> Program:
    """A cone on a spout, hollow; drawn as a section or of cones and cylinders."""
    wide, neck, wall = draw.length(40, 90), draw.length(8, 16), draw.length(1.5, 2.5)
    long, tall = draw.length(15, 30), draw.length(20, 50)
    if draw.coin():
        inner = [
            (neck / 2 - wall, 0),
            (neck / 2, 0),
            (neck / 2, long),
            (wide / 2, long + tall),
            (wide / 2 - wall, long + tall),
            (neck / 2 - wall, long),
        ]
        return turned(inner)
    body = unite(rod(neck, (0, 0, 0), long), taper(neck, wide, (0, 0, long), tall))
    hollow = taper(neck - 2 * wall, wide - 2 * wall, (0, 0, long), tall)
    return cut(body, hollow, through(neck - 2 * wall, (0, 0, 0), long))


def ball_joint(draw: Draw) -> Program:
    """A ball on a rod on a foot with holes."""
    wide, stem, t = draw.length(10, 24), draw.length(4, 8), draw.length(3, 6)
    foot, up = draw.length(24, 40), draw.length(12, 30)
    body = unite(stand(0, 0, 0, (foot, foot, t)), rod(stem, (0, 0, t), up), ball(wide, (0, 0, t + up)))
    return cut(body, *(through(3.4, (x, y, 0), t) for x, y in four(foot / 2 - 4, foot / 2 - 4)))


def wheel(draw: Draw) -> Program:
    """A rim, a web with a circle of holes that save weight, and a hub."""
    wide, t, hub = draw.length(50, 110), draw.length(8, 16), draw.length(14, 24)
    rim, web, bore = draw.length(4, 8), draw.length(3, 6), draw.length(5, 10)
    inner, n = wide - 2 * rim, draw.count(4, 8)
    orbit = (inner + hub) / 4
    hole = min(draw.length(6, 14), (inner - hub) / 2 - 2)
    body = unite(cut(rod(wide, (0, 0, 0), t), blind(inner, (0, 0, t), t - web)), rod(hub, (0, 0, 0), t))
    return cut(body, through(bore, (0, 0, 0), t), *(through(hole, (x, y, 0), web) for x, y in circle(orbit, n)))


def cup(draw: Draw) -> Program:
    """A hollow cylinder, open at the top, with a notch or a hole in its side."""
    wide, h, wall = draw.length(20, 70), draw.length(20, 80), draw.length(1.5, 4)
    body: Program = cut(rod(wide, (0, 0, 0), h), blind(wide - 2 * wall, (0, 0, h), h - wall))
    if draw.coin(0.4):
        return cut(body, rod(draw.length(3, 8), (0, 0, h / 2), wide, 0))
    return cut(body, window(wide / 2, 0, h / 2, (wide, draw.length(4, 10), h))) if draw.coin(0.3) else body


def o_ring_seat(draw: Draw) -> Program:
    """A plug with a round groove, a head and a blind hole."""
    wide, long, head = draw.length(10, 30), draw.length(10, 25), draw.length(3, 6)
    thick = draw.length(1.5, 2.5)
    body = unite(rod(wide + 8, (0, 0, 0), head), rod(wide, (0, 0, head), long))
    groove = Primitive("torus", (wide / 2, thick), (0, 0, head + long / 2))
    return cut(body, groove, blind(wide / 3, (0, 0, head + long), long / 2))


def dome_foot(draw: Draw) -> Program:
    """A flat dome over a short cylinder, with a countersunk screw from above."""
    wide, low, up = draw.length(14, 40), draw.length(2, 8), draw.length(3, 8)
    hole, head = draw.screw()
    dome = Primitive("ellipsoid", (wide / 2, wide / 2, up), (0, 0, low))
    return cut(unite(rod(wide, (0, 0, 0), low), dome), through(hole, (0, 0, 0), low + up), blind(min(head, wide - 4), (0, 0, low + up), up))


ROUNDS = (
    flange, bushing, shaft, knob, standoff, pulley, pillow_block, funnel, ball_joint, wheel, cup, o_ring_seat, dome_foot,
)  # fmt: skip
