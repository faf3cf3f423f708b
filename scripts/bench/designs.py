"""Parts drawn as a designer would: a function of named dimensions, each from a datum that its formula says.

Ten kinds take turns. Each draws its dimensions from a generator, in whole or half millimetres, and is made by manifold3d alone, which
tells what the part is with any one dimension changed. What grows does so from where the kind's docstring says.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from manifold3d import Manifold, OpType

SEGMENTS = 96
BEYOND = 1.0  # by which cutters stick out

Values = Mapping[str, float]


class Design(NamedTuple):
    """A part as a function of its dimensions, in mm, and the values that these have."""

    build: Callable[[Values], Manifold]
    values: dict[str, float]


def design(rng: np.random.Generator, number: int) -> Design:
    """The part of that number."""
    build, draw = KINDS[number % len(KINDS)]
    return Design(build, {name: _half(rng.uniform(low, high)) for name, (low, high) in draw.items()})


def _half(value: float) -> float:
    return round(2 * value) / 2


def _box(low: tuple[float, float, float], size: tuple[float, float, float]) -> Manifold:
    return Manifold.cube(size).translate(low)


def _middle(x: float, y: float, z: float, size: tuple[float, float, float]) -> Manifold:
    """A box about (x, y) that stands at z."""
    return _box((x - size[0] / 2, y - size[1] / 2, z), size)


def _rod(diameter: float, at: tuple[float, float, float], length: float, axis: int = 2) -> Manifold:
    """A cylinder that begins at a point and runs along an axis."""
    rod = Manifold.cylinder(length, diameter / 2, diameter / 2, SEGMENTS)
    turned = rod if axis == 2 else rod.rotate((-90.0, 0.0, 0.0)) if axis == 1 else rod.rotate((0.0, 90.0, 0.0))
    return turned.translate(at)


def _hole(diameter: float, at: tuple[float, float, float], length: float, axis: int = 2) -> Manifold:
    """A cutter as long as what it goes through, which it leaves on both sides."""
    start = tuple(c - BEYOND if i == axis else c for i, c in enumerate(at))
    return _rod(diameter, start, length + 2 * BEYOND, axis)  # type: ignore[arg-type]


def _cut(body: Manifold, *cutters: Manifold) -> Manifold:
    return Manifold.batch_boolean([body, *cutters], OpType.Subtract)


def _both(*at: float) -> list[tuple[float, ...]]:
    """All combinations of signs of half the distances."""
    return [tuple(s * a / 2 for s, a in zip(signs, at, strict=True)) for signs in itertools.product((-1, 1), repeat=len(at))]


def _plate(v: Values) -> Manifold:
    """A plate about its middle, with a bore there and a hole near each corner; it grows upwards."""
    body = _middle(0, 0, 0, (v["length"], v["width"], v["thickness"]))
    holes = [_hole(v["hole"], (x, y, 0), v["thickness"]) for x, y in _both(v["spacing_x"], v["spacing_y"])]
    return _cut(body, _hole(v["bore"], (0, 0, 0), v["thickness"]), *holes)


def _cornered(v: Values) -> Manifold:
    """A plate from its corner, and from there a pocket from above and two holes."""
    body = _box((0, 0, 0), (v["length"], v["width"], v["thickness"]))
    pocket = _box((v["pocket_x"], v["pocket_y"], v["thickness"] - v["depth"]), (v["pocket_length"], v["pocket_width"], v["depth"] + BEYOND))
    holes = [_hole(v["hole"], (x, v["hole_y"], 0), v["thickness"]) for x in (v["hole_x"], v["hole_x"] + v["pitch"])]
    return _cut(body, pocket, *holes)


def _bracket(v: Values) -> Manifold:
    """A foot before a wall, which stands on its back edge, and a rib between both; all in the middle of its width."""
    foot = _box((-v["width"] / 2, -v["depth"], 0), (v["width"], v["depth"], v["foot_thickness"]))
    wall = _box((-v["width"] / 2, -v["wall_thickness"], 0), (v["width"], v["wall_thickness"], v["height"]))
    reach, rise = v["wall_thickness"] + v["rib_length"], v["foot_thickness"] + v["rib_height"]
    rib = _box((-v["rib_thickness"] / 2, -reach, 0), (v["rib_thickness"], reach, rise))
    in_foot = [
        _hole(v["foot_hole"], (x, -v["depth"] + v["foot_hole_edge"], 0), v["foot_thickness"]) for (x,) in _both(v["foot_hole_spacing"])
    ]
    place = (0.0, -v["wall_thickness"], v["wall_hole_height"])
    return _cut(foot + wall + rib, *in_foot, _hole(v["wall_hole"], place, v["wall_thickness"], 1))


def _flange(v: Values) -> Manifold:
    """A disc with a boss that stands on it, a bore through both, and a circle of six holes."""
    disc, boss = _rod(v["diameter"], (0, 0, 0), v["thickness"]), _rod(v["boss"], (0, 0, 0), v["thickness"] + v["boss_height"])
    turns = [math.tau * k / 6 for k in range(6)]
    holes = [_hole(v["hole"], (v["circle"] / 2 * math.cos(a), v["circle"] / 2 * math.sin(a), 0), v["thickness"]) for a in turns]
    return _cut(disc + boss, _hole(v["bore"], (0, 0, 0), v["thickness"] + v["boss_height"]), *holes)


def _tray(v: Values) -> Manifold:
    """A tray about its middle, open above, with a post so far from each inner corner, and a blind hole down each post."""
    length, width, wall, floor = v["length"], v["width"], v["wall"], v["floor"]
    body = _middle(0, 0, 0, (length, width, v["height"]))
    inside = _middle(0, 0, floor, (length - 2 * wall, width - 2 * wall, v["height"] - floor + BEYOND))
    places = _both(length - 2 * wall - 2 * v["inset"], width - 2 * wall - 2 * v["inset"])
    posts = [_rod(v["post"], (x, y, 0), floor + v["post_height"]) for x, y in places]
    top = floor + v["post_height"]
    drilled = [_rod(v["screw"], (x, y, top - v["screw_depth"]), v["screw_depth"] + BEYOND) for x, y in places]
    return _cut(Manifold.batch_boolean([_cut(body, inside), *posts], OpType.Add), *drilled)


def _frame(v: Values) -> Manifold:
    """A frame about its middle, with a ledge at the bottom of each short wall, and a hole in each ledge so far from that wall."""
    length, width, wall = v["length"], v["width"], v["wall"]
    body = _cut(
        _middle(0, 0, 0, (length, width, v["height"])),
        _middle(0, 0, -BEYOND, (length - 2 * wall, width - 2 * wall, v["height"] + 2 * BEYOND)),
    )
    inner = length / 2 - wall
    for side in (-1, 1):
        ledge = _middle(side * (inner - v["ledge_length"] / 2), 0, 0, (v["ledge_length"], v["ledge_width"], v["ledge_thickness"]))
        body = _cut(body + ledge, _hole(v["hole"], (side * (inner - v["hole_edge"]), 0, 0), v["ledge_thickness"]))
    return body


def _clevis(v: Values) -> Manifold:
    """A base with two lugs that stand on it so far apart, a pin's hole through both so high above it, and two holes in the base."""
    base = _middle(0, 0, 0, (v["length"], v["width"], v["base"]))
    outer = v["gap"] + 2 * v["lug"]
    lugs = [_middle(s * (v["gap"] + v["lug"]) / 2, 0, 0, (v["lug"], v["lug_width"], v["base"] + v["lug_height"])) for s in (-1, 1)]
    pin = _hole(v["pin"], (-outer / 2, 0.0, v["base"] + v["pin_height"]), outer, 0)
    holes = [_hole(v["hole"], (x, 0, 0), v["base"]) for (x,) in _both(v["spacing"])]
    return _cut(Manifold.batch_boolean([base, *lugs], OpType.Add), pin, *holes)


def _shaft(v: Values) -> Manifold:
    """A shaft of three steps, each from the shoulder before it, with a blind bore from the end and a cross hole from the other one."""
    at, body = 0.0, Manifold()
    for step in "abc":
        body, at = body + _rod(v[f"diameter_{step}"], (at, 0.0, 0.0), v[f"length_{step}"], 0), at + v[f"length_{step}"]
    bore = _rod(v["bore"], (-BEYOND, 0.0, 0.0), BEYOND + v["bore_depth"], 0)
    wide = v["diameter_c"]
    return _cut(body, bore, _hole(v["cross"], (at - v["cross_edge"], 0.0, -wide / 2), wide))


def _rail(v: Values) -> Manifold:
    """A block with a slot along the middle of its top, and three counterbored holes in the slot."""
    body = _middle(0, 0, 0, (v["length"], v["width"], v["height"]))
    slot = _middle(0, 0, v["height"] - v["slot_depth"], (v["length"] + 2 * BEYOND, v["slot"], v["slot_depth"] + BEYOND))
    floor = v["height"] - v["slot_depth"]
    bores = [_rod(v["head"], (k * v["pitch"], 0, floor - v["head_depth"]), v["head_depth"] + BEYOND) for k in (-1, 0, 1)]
    return _cut(body, slot, *bores, *(_hole(v["hole"], (k * v["pitch"], 0, 0), floor) for k in (-1, 0, 1)))


def _ribbed(v: Values) -> Manifold:
    """A plate with a boss in its middle, two ribs along it that stand so far apart, and a bore through the boss."""
    plate = _middle(0, 0, 0, (v["length"], v["width"], v["thickness"]))
    boss = _rod(v["boss"], (0, 0, 0), v["thickness"] + v["boss_height"])
    ribs = [_middle(0, y, 0, (v["rib_length"], v["rib"], v["thickness"] + v["rib_height"])) for (y,) in _both(v["rib_spacing"])]
    bore = _hole(v["bore"], (0, 0, 0), v["thickness"] + v["boss_height"])
    return _cut(Manifold.batch_boolean([plate, boss, *ribs], OpType.Add), bore)


Ranges = Mapping[str, tuple[float, float]]

KINDS: tuple[tuple[Callable[[Values], Manifold], Ranges], ...] = (
    (
        _plate,
        {
            "length": (90, 120),
            "width": (60, 75),
            "thickness": (6, 12),
            "spacing_x": (62, 74),
            "spacing_y": (38, 46),
            "hole": (5, 8),
            "bore": (16, 26),
        },
    ),
    (
        _cornered,
        {"length": (90, 120), "width": (50, 65), "thickness": (10, 16), "pocket_x": (8, 14), "pocket_y": (7, 11), "pocket_length": (28, 38)}
        | {"pocket_width": (18, 26), "depth": (4, 7), "hole": (5, 8), "hole_x": (58, 64), "hole_y": (16, 24), "pitch": (14, 20)},
    ),
    (
        _bracket,
        {
            "width": (50, 70),
            "depth": (45, 60),
            "height": (50, 70),
            "foot_thickness": (6, 8),
            "wall_thickness": (8.5, 11),
            "rib_length": (16, 24),
        }
        | {"rib_height": (14, 20), "rib_thickness": (5, 8), "foot_hole": (5, 7), "foot_hole_edge": (9, 12), "foot_hole_spacing": (28, 36)}
        | {"wall_hole": (9, 14), "wall_hole_height": (38, 42)},
    ),
    (
        _flange,
        {
            "diameter": (90, 110),
            "thickness": (8, 12),
            "boss": (40, 48),
            "boss_height": (12, 20),
            "bore": (20, 30),
            "circle": (68, 76),
            "hole": (6, 9),
        },
    ),
    (
        _tray,
        {
            "length": (100, 120),
            "width": (60, 80),
            "height": (22, 30),
            "wall": (2, 3.5),
            "floor": (4, 5.5),
            "post": (8, 10),
            "post_height": (9, 14),
        }
        | {"inset": (7, 10), "screw": (3, 4.5), "screw_depth": (6, 8)},
    ),
    (
        _frame,
        {"length": (110, 140), "width": (60, 80), "height": (10, 16), "wall": (3, 5), "ledge_length": (14, 20), "ledge_width": (20, 30)}
        | {"ledge_thickness": (3, 5), "hole": (4, 6), "hole_edge": (5, 6.5)},
    ),
    (
        _clevis,
        {
            "length": (90, 110),
            "width": (40, 50),
            "base": (8, 11),
            "gap": (20, 28),
            "lug": (6, 9),
            "lug_width": (24, 32),
            "lug_height": (26, 34),
        }
        | {"pin": (9, 13), "pin_height": (15, 18), "hole": (6, 9), "spacing": (66, 76)},
    ),
    (
        _shaft,
        {
            "diameter_a": (18, 22),
            "diameter_b": (30, 36),
            "diameter_c": (24, 27),
            "length_a": (25, 35),
            "length_b": (12, 18),
            "length_c": (35, 45),
        }
        | {"bore": (7, 11), "bore_depth": (18, 24), "cross": (5, 7), "cross_edge": (9, 14)},
    ),
    (
        _rail,
        {
            "length": (100, 130),
            "width": (30, 40),
            "height": (18, 24),
            "slot": (14, 18),
            "slot_depth": (5, 7),
            "pitch": (28, 34),
            "hole": (5, 6.5),
        }
        | {"head": (9, 11), "head_depth": (4, 6)},
    ),
    (
        _ribbed,
        {"length": (90, 120), "width": (60, 80), "thickness": (6, 9), "boss": (24, 30), "boss_height": (16, 22), "bore": (10, 15)}
        | {"rib_length": (70, 80), "rib": (4, 6), "rib_height": (8, 12), "rib_spacing": (42, 50)},
    ),
)
