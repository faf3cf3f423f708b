"""Circles that rounding has parted are circles again, of a round radius, unless that is not borne."""

import math
from dataclasses import replace

import pytest

from imdim.geometry.solid import exact_rotation, to_manifold, volume_iou
from imdim.numbers.circles import round_circles
from imdim.program.outline import Outline
from imdim.program.tree import Primitive, Program, combine_all, leaves, map_leaves

DISC = Primitive("cylinder", (20.0, 5.0), (3.0, 4.0, 2.5))


def bores(radius: float, count: int = 10, size: float = 2.0001, digits: int | None = None, kind: str = "cylinder") -> Program:
    """A disc with bores, or teeth, on a circle about it."""
    out: list[Program] = [DISC]
    for k in range(count):
        angle = 2 * math.pi * k / count
        x, y = (c + radius * f(angle) for c, f in ((3.0, math.cos), (4.0, math.sin)))
        at = (x, y, 2.5) if digits is None else (round(x, digits), round(y, digits), 2.5)
        turn = (0.0, 0.0, 0.0) if kind == "cylinder" else (0.0, 0.0, math.degrees(angle))
        out.append(Primitive(kind, (size, 6.0) if kind == "cylinder" else (4.0, size, 6.0), at, turn))
    return combine_all("difference", out)


def radii(program: Program) -> list[float]:
    return [math.dist(leaf.center[:2], DISC.center[:2]) for leaf in leaves(program)][1:]


@pytest.mark.parametrize("kind", ["cylinder", "box"])
def test_what_rounding_has_parted_is_a_circle_again(kind: str) -> None:
    before, after = bores(15.50009, kind=kind), bores(15.50009, size=2.0, digits=1, kind=kind)
    out = round_circles(before, after, lambda trial: all(abs(r - 15.50009) < 0.002 for r in radii(trial)))
    assert radii(out) == pytest.approx([15.5] * 10, abs=1e-9)
    assert [leaf.size for leaf in leaves(out)] == [leaf.size for leaf in leaves(after)]
    assert volume_iou(to_manifold(out), to_manifold(bores(15.5, size=2.0, kind=kind))) == pytest.approx(1.0, abs=1e-7)


def test_the_circle_goes_with_its_hub() -> None:
    before, after = bores(15.5), bores(15.5, digits=1)
    moved = map_leaves(after, lambda i, leaf: leaf if i else Primitive("cylinder", leaf.size, (3.001, 4.0, 2.5)))
    out = round_circles(before, moved, lambda trial: True)
    assert [math.dist(leaf.center[:2], (3.001, 4.0)) for leaf in leaves(out)][1:] == pytest.approx([16.0] * 10, abs=0.6)
    assert len({round(math.dist(leaf.center[:2], (3.001, 4.0)), 9) for leaf in leaves(out)}) == 2


def row(angle: float, digits: int | None = None) -> Program:
    """A disc with a row of bores along some direction."""
    places = [(10.0 * k * math.cos(angle), 10.0 * k * math.sin(angle), 2.5) for k in range(5)]
    at = places if digits is None else [(round(x, digits), round(y, digits), 2.5) for x, y, _ in places]
    return combine_all("difference", [DISC, *(Primitive("cylinder", (2.0 if digits else 2.0001, 6.0), center) for center in at)])


def test_a_slanting_row_stays_one() -> None:
    out = round_circles(row(0.4), row(0.4, 1), lambda trial: True)
    assert [leaf.center for leaf in leaves(out)] == [leaf.center for leaf in leaves(row(0.4))]
    assert [leaf.size for leaf in leaves(out)] == [leaf.size for leaf in leaves(row(0.4, 1))]


def test_a_grid_that_slants_by_single_precision_is_rounded() -> None:
    """Places of a mesh's balls differ by their last bits: their grid stays one, with round numbers."""

    def balls(noise: float) -> Program:
        at = [(4.5 + 6.4 * x, 4.5 + 6.45 * y, 0.8 + noise * (x + y)) for x in (0, 1) for y in range(3)]
        return combine_all("union", [Primitive("box", (15.4, 23.4, 0.8), (7.7, 11.7, 0.4)), *(Primitive("sphere", (2.5,), c) for c in at)])

    assert round_circles(balls(1e-7), balls(0.0), lambda trial: True) == balls(0.0)


def test_a_row_along_an_axis_is_rounded_place_by_place() -> None:
    assert round_circles(row(0.0), row(0.0, 1), lambda trial: False) == row(0.0, 1)


def test_what_is_not_borne_stays() -> None:
    before, after = bores(15.5), bores(15.5, digits=1)
    assert round_circles(before, after, lambda trial: False) == after


def test_a_circle_that_rounding_keeps_is_not_rounded_on() -> None:
    before, after = bores(15.456, count=4), bores(15.46, count=4)
    assert round_circles(before, after, lambda trial: True) == after


def test_what_is_on_no_circle_stays_rounded() -> None:
    before, after = bores(15.5, digits=2), bores(15.5, digits=1)
    assert round_circles(before, after, lambda trial: True) == after


def test_what_is_turned_about_its_own_middle_stays_there() -> None:
    """Three arms of one outline each: their common middle is no circle."""
    arm = Outline((((-2.0, 0.0, 0.0), (2.0, 0.0, 0.0), (1.0, 20.0, 0.0), (-1.0, 20.0, 0.0)),))
    arms = [Primitive("extrude", (4.0,), (3.0, 4.0, 9.0), (0.0, 0.0, 120.0 * k), arm) for k in range(3)]
    before = combine_all("union", [DISC, *arms])
    after = map_leaves(before, lambda i, leaf: replace(leaf, size=(4.1,)) if i == 1 else leaf)
    out = list(leaves(round_circles(before, after, lambda trial: True)))
    assert [leaf.size for leaf in out][1:] == [(4.1,)] * 3
    assert all(leaf.center == pytest.approx((3.0, 4.0, 9.0)) for leaf in out[1:])


TUBE = Outline((((1.0, -3.0, 0.0), (2.0002, -3.0, 0.0), (2.0002, 3.0, 0.0), (1.0, 3.0, 0.0)),))


@pytest.mark.parametrize(("tilt", "straightened"), [(1e-4, True), (2.0, False)])
def test_drawn_copies_keep_their_rounded_drawing_and_a_hair_of_turn(tilt: float, straightened: bool) -> None:
    """Three turned rings that look 1e-4 degrees past their hub got their first drawing and that angle back; what is turned by more was
    rounded for itself, and is turned as it was."""
    centers = [(3.0 + 15.0 * math.cos(math.radians(120.0 * k)), 4.0 + 15.0 * math.sin(math.radians(120.0 * k)), 9.0) for k in range(3)]
    rings = [Primitive("revolve", (360.0,), c, (0.0, 90.0, 120.0 * k + tilt), TUBE) for k, c in enumerate(centers)]
    rounder = Outline((tuple((round(x, 3), y, b) for x, y, b in TUBE.loops[0]),))
    before = combine_all("union", [DISC, *rings])

    def rounded(i: int, leaf: Primitive) -> Primitive:
        return replace(leaf, outline=rounder, rotation=(0.0, 90.0, 120.0 * (i - 1)), center=(*leaf.center[:2], 9.0 + i)) if i else leaf

    after = map_leaves(before, rounded)
    out = list(leaves(round_circles(before, after, lambda trial: True)))[1:]
    assert len({leaf.center[2] for leaf in out}) == 1
    assert {leaf.outline for leaf in out} == {rounder if straightened else TUBE}
    for k, leaf in enumerate(out):
        axis = exact_rotation(leaf)[:, 2]
        turned = math.degrees(math.atan2(axis[1], axis[0])) - 120.0 * k
        assert math.remainder(turned, 360.0) == pytest.approx(0.0 if straightened else tilt, abs=1e-9)


@pytest.mark.parametrize("flipped", [False, True])
def test_a_circle_stands_at_a_round_angle(flipped: bool) -> None:
    def turned(degrees: float, digits: int) -> Program:
        program = bores(15.5, count=5)
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        places = [(leaf.center[0] - 3.0, leaf.center[1] - 4.0) for leaf in leaves(program)]
        at = [(round(3.0 + c * x - s * y, digits), round(4.0 + s * x + c * y, digits), 2.5) for x, y in places]
        up = (180.0, 0.0, 0.0) if flipped else (0.0, 0.0, 0.0)
        return map_leaves(program, lambda i, leaf: replace(leaf, center=at[i], rotation=up) if i else leaf)

    out = list(leaves(round_circles(turned(10.002, 9), turned(10.002, 2), lambda trial: True)))[1:]
    angles = sorted(math.degrees(math.atan2(leaf.center[1] - 4.0, leaf.center[0] - 3.0)) % 72.0 for leaf in out)
    assert angles == pytest.approx([10.0] * 5, abs=1e-9)


def tabs(inner: float, outer: float, digits: int = 9) -> Program:
    """A disc with eight tabs about it, which reach from one distance to another."""
    out: list[Program] = [DISC]
    for k in range(8):
        angle, middle = math.pi * k / 4, (inner + outer) / 2
        at = (round(3.0 + middle * math.cos(angle), digits), round(4.0 + middle * math.sin(angle), digits), 2.5)
        out.append(Primitive("box", (round(outer - inner, digits), 4.0, 2.0), at, (0.0, 0.0, math.degrees(angle))))
    return combine_all("union", out)


@pytest.mark.parametrize(
    ("inner", "outer", "precision", "expected"),
    [
        (19.897, 27.84, 1e-6, (None, 27.84)),  # the outer end was typed, the inner one is where its edges meet the disc
        (19.897, 27.841237, 1e-6, (19.897, None)),
        (20.0, 27.84, 1e-6, (20.0, 27.84)),  # so was the middle
        (19.897, 27.84, 0.0, None),  # nobody knows how well places are measured: the roundest
    ],
)
def test_typed_ends_of_tabs_stay(inner: float, outer: float, precision: float, expected: tuple[float | None, ...] | None) -> None:
    out = list(leaves(round_circles(tabs(inner, outer), tabs(inner, outer, 2), lambda trial: True, precision)))[1:]
    middle, length = math.dist(out[0].center[:2], DISC.center[:2]), out[0].size[0]
    if expected is None:
        assert middle == pytest.approx(24.0, abs=0.2)
    for end, found in zip(expected or (), (middle - length / 2, middle + length / 2), strict=False):
        assert end is None or found == pytest.approx(end, abs=1e-9)
    assert len({round(math.dist(leaf.center[:2], DISC.center[:2]), 9) for leaf in out}) == 1
