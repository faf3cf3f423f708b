"""Designs of the corpus that are plates, angles and blocks: functions of a designer's choices, in millimetres."""

from __future__ import annotations

from features import (
    BEYOND,
    UPRIGHT,
    Draw,
    blind,
    block,
    circle,
    countersink,
    cut,
    extrusion,
    four,
    pocket,
    ring,
    rod,
    rounded,
    slot,
    stand,
    through,
    unite,
    window,
)

from imdim.program.tree import Program


def mounting_plate(draw: Draw) -> Program:
    """A plate with four screw holes, often with round corners, a bore and countersinks."""
    w, d, t = draw.length(40, 120), draw.length(30, 80), draw.length(3, 10)
    hole, head = draw.screw()
    x, y = w / 2 - draw.length(6, 10), d / 2 - draw.length(6, 10)
    body = extrusion([rounded(w, d, draw.length(2, 6))], (0, 0, t / 2), t) if draw.coin(0.4) else stand(0, 0, 0, (w, d, t))
    cuts: list[Program] = [through(hole, (u, v, 0), t) for u, v in four(x, y)]
    if draw.coin(0.3) and head - hole < 2 * t:
        cuts += [countersink(hole, head, (u, v, t)) for u, v in four(x, y)]
    if draw.coin():
        cuts.append(through(draw.length(8, min(d - 25, 40)) if d > 40 else 8.0, (0, 0, 0), t))
    return cut(body, *cuts)


def angle_bracket(draw: Draw) -> Program:
    """Two legs, holes in both, sometimes ribs between them."""
    w, d, h, t = draw.length(30, 80), draw.length(20, 60), draw.length(25, 70), draw.length(3, 8)
    hole, _ = draw.screw()
    if draw.coin(0.3):
        profile = ring([(0, 0), (w, 0), (w, t), (t, t), (t, h), (0, h)])
        body: Program = extrusion([profile], (0, 0, 0), d, UPRIGHT)
    else:
        body = unite(block((0, -d / 2, 0), (w, d, t)), block((0, -d / 2, 0), (t, d, h)))
    if draw.coin(0.4):
        reach, thick = draw.length(10, min(w, h) - t - 5), draw.length(2, 5)
        rib = ring([(t, t), (t + reach, t), (t, t + reach)])
        places = [d / 2 - thick / 2, thick / 2 - d / 2] if draw.coin() else [0.0]
        body = unite(body, *(extrusion([rib], (0, y, 0), thick, UPRIGHT) for y in places))
    y, x, z = d / 4, (w + t) / 2, (h + t) / 2
    flat, upright = ([0.0], [0.0]) if d < 30 else ([y, -y], [y, -y])
    cuts = [through(hole, (x, v, 0), t) for v in flat] + [through(hole, (0, v, z), t, 0) for v in upright]
    return cut(body, *cuts)


def clevis(draw: Draw) -> Program:
    """A base with two ears and a cross bore through both."""
    w, d, t = draw.length(30, 60), draw.length(20, 40), draw.length(4, 10)
    ear, h = draw.length(4, 9), draw.length(20, 45)
    bore, axis_z = draw.length(5, min(d - 8, 16)), t + h - d / 2
    x = w / 2 - ear
    ears: list[Program] = [block((-w / 2, -d / 2, t), (ear, d, h - d / 2)), block((x, -d / 2, t), (ear, d, h - d / 2))]
    ears += [rod(d, (-w / 2, 0, axis_z), ear, 0), rod(d, (x, 0, axis_z), ear, 0)]
    if draw.coin(0.4):
        hole, _ = draw.screw()
        return cut(unite(stand(0, 0, 0, (w, d, t)), *ears), through(bore, (-w / 2, 0, axis_z), w, 0), through(hole, (0, 0, 0), t))
    return cut(unite(stand(0, 0, 0, (w, d, t)), *ears), through(bore, (-w / 2, 0, axis_z), w, 0))


def tray(draw: Draw) -> Program:
    """An open box, sometimes with round corners, posts with pilot holes, and windows for cables."""
    w, d, h, wall = draw.length(50, 130), draw.length(40, 90), draw.length(15, 45), draw.length(1.5, 4)
    floor = wall if draw.coin(0.7) else draw.length(2, 4)
    if draw.coin(0.35):
        r = wall + draw.length(1, 4)
        shell: Program = cut(
            extrusion([rounded(w, d, r)], (0, 0, h / 2), h),
            extrusion([rounded(w - 2 * wall, d - 2 * wall, r - wall)], (0, 0, (floor + h + BEYOND) / 2), h + BEYOND - floor),
        )
    else:
        shell = cut(stand(0, 0, 0, (w, d, h)), pocket(0, 0, h, (w - 2 * wall, d - 2 * wall, h - floor)))
    if draw.coin(0.6):
        post, pilot, tall = draw.length(5, 8), draw.length(2, 3.5), draw.length(3, 8)
        places = four(w / 2 - wall - post, d / 2 - wall - post)
        shell = unite(shell, *(rod(post, (x, y, floor), tall) for x, y in places))
        shell = cut(shell, *(blind(pilot, (x, y, floor + tall), tall) for x, y in places))
    if draw.coin():
        wide, up = draw.length(8, 20), draw.length(floor + 2, h / 2)
        shell = cut(shell, block((w / 2 - wall - BEYOND, -wide / 2, up), (wall + 2 * BEYOND, wide, draw.length(4, h / 3))))
    return shell


def lid(draw: Draw) -> Program:
    """A plate with a lip under it, a row of vents and screw holes."""
    w, d, t, wall = draw.length(50, 120), draw.length(40, 90), draw.length(2, 4), draw.length(1.5, 3)
    lip, gap = draw.length(3, 6), draw.length(1.5, 3)
    x, y = w - 2 * gap, d - 2 * gap
    frame = cut(stand(0, 0, -lip, (x, y, lip)), window(0, 0, -lip, (x - 2 * wall, y - 2 * wall, lip)))
    cuts: list[Program] = []
    if draw.coin(0.6):
        n, pitch, wide = draw.count(3, 8), draw.length(4, 6), draw.length(1.5, 3)
        cuts += [window((i - (n - 1) / 2) * pitch, 0, 0, (wide, d / 2, t)) for i in range(n)]
    if draw.coin(0.4):
        cuts += [through(draw.screw()[0], (0, sy * (d / 2 - 8), 0), t) for sy in (1, -1)]
    return cut(unite(stand(0, 0, 0, (w, d, t)), frame), *cuts)


def motor_mount(draw: Draw) -> Program:
    """A face with a large bore, four screws or slots about it, on a foot."""
    w, h, t = draw.length(40, 60), draw.length(42, 60), draw.length(4, 8)
    foot, bore, apart = draw.length(20, 45), draw.length(20, 26), draw.length(26, 32)
    hole, _ = draw.screw()
    z = h / 2
    body = unite(block((-w / 2, 0, 0), (w, t, h)), block((-w / 2, 0, 0), (w, foot, t)))
    cuts: list[Program] = [through(bore, (0, 0, z), t, 1)]
    cuts += [through(3.4, (u, 0, z + v), t, 1) for u, v in four(apart / 2, apart / 2)]
    if draw.coin():
        long = draw.length(6, 12)
        cuts += [extrusion([slot(long, hole)], (sx * w / 4, (foot + t) / 2, t / 2), t + 2 * BEYOND, (0, 0, 90)) for sx in (1, -1)]
    else:
        cuts += [through(hole, (sx * w / 4, (foot + t) / 2, 0), t) for sx in (1, -1)]
    return cut(body, *cuts)


def hinge(draw: Draw) -> Program:
    """A leaf with knuckles along an edge, a pin's bore and countersunk holes."""
    d, t, n = draw.length(20, 40), draw.length(2, 4), draw.count(1, 3)
    long, outer = draw.length(6, 12), draw.length(6, 10)
    w = (2 * n - 1) * long
    knuckles = [rod(outer, (2 * i * long, 0, outer / 2), long, 0) for i in range(n)]
    hole, head = draw.screw()
    places = [w / 4, 3 * w / 4] if w > 30 else [w / 2]
    cuts: list[Program] = [through(draw.length(2, outer - 3), (0, 0, outer / 2), w, 0)]
    cuts += [through(hole, (x, d / 2, 0), t) for x in places]
    if draw.coin() and head - hole < 2 * t:
        cuts += [countersink(hole, head, (x, d / 2, t)) for x in places]
    return cut(unite(block((0, 0, 0), (w, d, t)), *knuckles), *cuts)


def tool_rack(draw: Draw) -> Program:
    """A block with a grid of round or square pockets."""
    n, m, pitch, h = draw.count(2, 6), draw.count(1, 3), draw.length(12, 22), draw.length(15, 40)
    deep, wide, edge = draw.length(8, h - 3), draw.length(6, pitch - 2), draw.length(2, 6)
    w, d = n * pitch + 2 * edge, m * pitch + 2 * edge
    places = [((i - (n - 1) / 2) * pitch, (j - (m - 1) / 2) * pitch) for i in range(n) for j in range(m)]
    if draw.coin(0.6):
        return cut(stand(0, 0, 0, (w, d, h)), *(blind(wide, (x, y, h), deep) for x, y in places))
    return cut(stand(0, 0, 0, (w, d, h)), *(pocket(x, y, h, (wide, wide, deep)) for x, y in places))


def heat_sink(draw: Draw) -> Program:
    """A base with a row of fins and two holes."""
    n, pitch, fin = draw.count(4, 10), draw.length(4, 7), draw.length(1, 2.5)
    d, base, tall = draw.length(25, 60), draw.length(2, 6), draw.length(8, 25)
    w = (n - 1) * pitch + fin
    fins = [block((i * pitch, 0, base), (fin, d, tall)) for i in range(n)]
    body = unite(block((0, 0, 0), (w, d, base)), *fins)
    return cut(body, *(through(3.4, (w / 2, y, 0), base + tall) for y in (6, d - 6))) if draw.coin(0.3) else body


def manifold(draw: Draw) -> Program:
    """A block with crossing bores, ports that are wider, and screw holes."""
    w, d, h = draw.length(40, 90), draw.length(30, 50), draw.length(25, 45)
    main, port = draw.length(6, 10), draw.length(12, 18)
    n = draw.count(1, 3)
    xs = [w * (i + 1) / (n + 1) - w / 2 for i in range(n)]
    cuts: list[Program] = [through(main, (-w / 2, 0, h / 2), w, 0), *(blind(main, (x, 0, h), h / 2) for x in xs)]
    cuts += [blind(port, (x, 0, h), draw.length(4, 8)) for x in xs[:1]]
    if draw.coin():
        cuts += [through(draw.screw()[0], (x, y, 0), h) for x, y in four(w / 2 - 6, d / 2 - 6)]
    return cut(stand(0, 0, 0, (w, d, h)), *cuts)


def slot_nut(draw: Draw) -> Program:
    """A bar of T section with a threaded hole."""
    long, neck, wide = draw.length(10, 30), draw.length(5, 8), draw.length(10, 16)
    low, high, bore = draw.length(2, 5), draw.length(1, 3), draw.length(2.5, 4.5)
    if draw.coin():
        half, thin = wide / 2, neck / 2
        section = ring(
            [(-half, 0), (half, 0), (half, low), (thin, low), (thin, low + high), (-thin, low + high), (-thin, low), (-half, low)]
        )
        body: Program = extrusion([section], (0, 0, 0), long, UPRIGHT)
    else:
        body = unite(stand(0, 0, 0, (wide, long, low)), stand(0, 0, low, (neck, long, high)))
    return cut(body, through(bore, (0, 0, 0), low + high))


def handle(draw: Draw) -> Program:
    """Two posts and a bar, with counterbored holes."""
    span, wide, h, t = draw.length(60, 130), draw.length(10, 20), draw.length(25, 45), draw.length(8, 14)
    hole, head = draw.screw()
    x = span / 2
    body = unite(*(stand(sx * x, 0, 0, (t, wide, h)) for sx in (1, -1)), stand(0, 0, h - t, (span + t, wide, t)))
    cuts: list[Program] = [through(hole, (sx * x, 0, 0), h) for sx in (1, -1)]
    if head < min(wide, t + 6):
        cuts += [blind(min(head, t - 1), (sx * x, 0, h), draw.length(3, 6)) for sx in (1, -1)]
    return cut(body, *cuts)


def wedge(draw: Draw) -> Program:
    """A block with a sloping top and a hole."""
    w, d, low, high = draw.length(40, 90), draw.length(20, 40), draw.length(3, 8), draw.length(15, 35)
    body = extrusion([ring([(0, 0), (w, 0), (w, low), (0, high)])], (0, 0, 0), d, UPRIGHT)
    return cut(body, through(draw.length(4, 10), (w / 4, 0, 0), high)) if draw.coin() else body


def cable_comb(draw: Draw) -> Program:
    """A bar with a row of round channels open at the top, and feet with holes."""
    n, wide, deep = draw.count(2, 6), draw.length(4, 8), draw.length(10, 20)
    pitch = wide + draw.length(3, 6)
    w, h = n * pitch, wide + draw.length(4, 8)
    hole, head = draw.screw()
    foot, t = head + draw.length(2, 5), draw.length(2, 4)
    body = unite(stand(0, 0, 0, (w, deep, h)), stand(0, 0, 0, (w + 2 * foot, deep, t)))
    cuts = [through(wide, ((i - (n - 1) / 2) * pitch, -deep / 2, h), deep, 1) for i in range(n)]
    return cut(body, *cuts, *(through(hole, (sx * (w + foot) / 2, 0, 0), t) for sx in (1, -1)))


def lever(draw: Draw) -> Program:
    """An arm with round ends, a boss on each, and bores."""
    apart, wide, t = draw.length(30, 90), draw.length(12, 20), draw.length(4, 8)
    tall, bore = t + draw.length(2, 10), draw.length(4, wide - 6)
    if draw.coin():
        arm: Program = extrusion([slot(apart, wide)], (0, 0, t / 2), t)
    else:
        arm = unite(stand(0, 0, 0, (apart, wide, t)), *(rod(wide, (sx * apart / 2, 0, 0), t) for sx in (1, -1)))
    bosses = [rod(wide, (apart / 2, 0, 0), tall)] if draw.coin(0.6) else []
    small = draw.length(3, bore) if draw.coin() else bore
    cuts = [through(bore, (apart / 2, 0, 0), tall), through(small, (-apart / 2, 0, 0), t)]
    return cut(unite(arm, *bosses), *cuts)


def corner(draw: Draw) -> Program:
    """Three plates that meet at a corner, with a hole in each."""
    a, t = draw.length(25, 60), draw.length(3, 6)
    hole, _ = draw.screw()
    body = unite(block((0, 0, 0), (a, a, t)), block((0, 0, 0), (a, t, a)), block((0, 0, 0), (t, a, a)))
    m = (a + t) / 2
    return cut(body, through(hole, (m, m, 0), t), through(hole, (m, 0, m), t, 1), through(hole, (0, m, m), t, 0))


def perforated(draw: Draw) -> Program:
    """A plate with a circle or a grid of holes, and feet."""
    w, t, hole = draw.length(50, 100), draw.length(2, 5), draw.length(3, 6)
    if draw.coin():
        places = circle(w / 2 - hole - 4, draw.count(6, 16))
        body: Program = rod(w, (0, 0, 0), t)
    else:
        n, m = draw.count(3, 6), draw.count(3, 6)
        pitch = hole + draw.length(2, 4)
        places = [((i - (n - 1) / 2) * pitch, (j - (m - 1) / 2) * pitch) for i in range(n) for j in range(m)]
        body = stand(0, 0, 0, (n * pitch + 10, m * pitch + 10, t))
    return cut(body, *(through(hole, (x, y, 0), t) for x, y in places))


PLATES = (
    mounting_plate, angle_bracket, clevis, tray, lid, motor_mount, hinge, tool_rack, heat_sink, manifold, slot_nut, handle, wedge,
    cable_comb, lever, corner, perforated,
)  # fmt: skip
