"""Drawn leaves in what finishes a program: ends of extrusions move, their sections and what is turned stay as they are."""

from dataclasses import replace

import numpy as np
import pytest
from manifold3d import Manifold
from outlined_samples import random_drawn, wraps
from tests.planted import box, cut, cylinder, union

from imdim.geometry.finish import active_zone
from imdim.geometry.finish.active_zone import matters
from imdim.geometry.finish.commute import Commutation
from imdim.geometry.finish.cutter_extent import narrow
from imdim.geometry.finish.overshoot import overshoot
from imdim.geometry.finish.pattern_outlier import regularise_outliers
from imdim.geometry.finish.posed import PosedPrimitive
from imdim.geometry.finish.section import flatten, inset
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.outline import Loop, Outline, check_crossings, circle
from imdim.program.tree import OUTLINED, Combine, Primitive, Program, leaves, map_leaves

SLOT: Loop = ((-4.0, -2.0, 0.0), (4.0, -2.0, 1.0), (4.0, 2.0, 0.0), (-4.0, 2.0, -0.6))
PLATE = box(60, 60, 6)
CORNERS = [(x, y, 0.0) for x in (-18.0, 18.0) for y in (-15.0, 15.0)]


def slot(h: float, center=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0), *holes: Loop) -> Primitive:
    return Primitive("extrude", (h,), center, rotation, Outline((SLOT, *holes)))


def difference(a: Manifold, b: Manifold) -> float:
    return (a - b).volume() + (b - a).volume()


def test_a_drawn_cutter_sticks_out_and_keeps_its_section():
    flush = cut(PLATE, slot(6.0))
    _, cutter = leaves(overshoot(flush))
    assert cutter == slot(8.0)
    _, pocket = leaves(overshoot(cut(PLATE, slot(2.0, (0.0, 0.0, 2.0), (0.0, 0.0, 30.0)))))
    assert pocket == slot(3.0, (0.0, 0.0, 2.5), (0.0, 0.0, 30.0))


def test_what_a_ring_does_not_cut_stays_where_it_stands():
    ring = cut(PLATE, slot(6.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), circle(1.0)))
    after = overshoot(ring)
    assert to_manifold(after).genus() == 0  # the core stands apart, and so it did
    assert difference(to_manifold(ring), to_manifold(after)) < 1e-6 * 6 * 60 * 60
    assert [*leaves(after)][1].outline == [*leaves(ring)][1].outline


def test_what_is_turned_stays():
    groove = Primitive(
        "revolve", (360.0,), (0.0, 0.0, 3.0), outline=Outline((((8.0, -2.0, 0.0), (10.0, -2.0, 0.0), (10.0, 0.0, 0.0), (8.0, 0.0, 0.0)),))
    )
    assert list(leaves(overshoot(cut(PLATE, groove))))[1] == groove


@pytest.mark.parametrize("probed", [True, False])
@pytest.mark.parametrize("kind", OUTLINED)
def test_whether_something_matters_beside_drawn_leaves(kind, probed, monkeypatch):
    """As the volume says that differs in the region between the box asked about taken as all of it and as nothing."""
    if not probed:
        monkeypatch.setattr(active_zone, "_shows_at_probes", lambda *_: False)
    rng, found = np.random.default_rng(1), []
    ops = ("union", "intersection", "difference")
    for _ in range(40):
        drawn = [random_drawn(rng, kind, 0.8, tuple(rng.normal(0, 0.2, 3).tolist()), tuple(rng.uniform(-90, 90, 3).tolist())) for _ in "ab"]
        own = Primitive("box", tuple(rng.uniform(0.4, 1.2, 3).tolist()), tuple(rng.normal(0, 0.3, 3).tolist()), (20.0, 30.0, 40.0))
        program = Combine(ops[rng.integers(3)], Combine(ops[rng.integers(3)], own, drawn[0]), drawn[1])
        region = replace(own, size=tuple(0.3 * s for s in own.size))
        everywhere, nowhere = (to_manifold(_with_box(program, size, region.center), 64) for size in (9.0, 1e-6))
        inside = to_manifold(region, 64)
        changed = ((everywhere - nowhere) ^ inside).volume() + ((nowhere - everywhere) ^ inside).volume()
        found.append(changed > 1e-6 * inside.volume())
        assert matters(program, [PosedPrimitive(leaf) for leaf in leaves(program)], 0, region) == found[-1]
    assert 5 < sum(found) < 38


def _with_box(program: Program, size: float, center) -> Program:
    return map_leaves(program, lambda i, p: replace(p, size=(size, size, size), center=center) if i == 0 else p)


def test_an_extrusion_asked_about_matters_where_it_cuts():
    program = cut(PLATE, slot(6.0))
    placed = [PosedPrimitive(leaf) for leaf in leaves(program)]
    assert matters(program, placed, 1, slot(1.0))
    assert not matters(program, placed, 1, slot(1.0, (0.0, 0.0, 4.0)))


def test_where_both_outlines_agree_the_polyhedron_does():
    rng = np.random.default_rng(3)
    for _ in range(10):
        leaf = random_drawn(rng, "extrude", 0.5)
        true, flat = PosedPrimitive(leaf).outlines
        assert flat is not None
        places = rng.uniform(-0.7, 0.7, (4000, 2))
        sure = wraps(true, places, 4000) == wraps(flat, places)
        section = PosedPrimitive(leaf).solid.slice(0.0)
        shown = wraps(Outline(tuple(tuple((x, y, 0.0) for x, y in p.tolist()) for p in section.to_polygons())), places)
        assert sure.mean() > 0.99
        np.testing.assert_array_equal(shown[sure], wraps(flat, places)[sure])


def test_an_inset_section_lies_inside_by_as_much():
    rng = np.random.default_rng(2)
    for _ in range(20):
        leaf = random_drawn(rng, "extrude", 0.5)
        inner = inset(leaf, 0.004)
        check_crossings(inner.outline)
        assert (to_manifold(inner, 64) - to_manifold(leaf, 64)).volume() < 1e-12
        assert 0.5 * leaf.outline.area < inner.outline.area < leaf.outline.area
        assert inset(leaf, 9.0).outline.area >= 0.5 * leaf.outline.area
    assert narrow(slot(6.0), 2).size == (6.0,)
    assert len(flatten(Outline((circle(1.0),))).curves) == 64


def test_drawn_holes_that_stand_apart_are_cut_last_as_long_as_each_other():
    first = cut(box(100, 60, 6), slot(20.0, (-30.0, 0.0, 0.0)))
    program = cut(union(first, box(100, 60, 6, (0.0, 0.0, 5.0))), slot(9.0, (-30.0, 0.0, 5.0)), slot(30.0, (30.0, 0.0, 0.0)))
    gathered = Commutation(program).commute()
    assert gathered is not None
    assert difference(to_manifold(gathered.program), to_manifold(program)) < 1e-5 * to_manifold(program).volume()
    last = [leaf for leaf in leaves(gathered.program) if leaf.kind == "extrude"]
    assert all(leaf.outline == slot(1.0).outline for leaf in last)
    assert len({(leaf.size, leaf.center[2]) for leaf in last if leaf in [*leaves(gathered.program)][gathered.core :]}) == 1


def test_an_odd_hole_becomes_a_drawn_one_as_in_the_target():
    holes: list[Primitive] = [slot(12.0, place) for place in CORNERS]
    target = to_manifold(cut(PLATE, *holes))
    holes[2] = box(9.8, 4.1, 12.0, (CORNERS[2][0] + 1.1, CORNERS[2][1], 0.3))
    after = regularise_outliers(cut(PLATE, *holes), 1e-3, lambda program: volume_iou(target, to_manifold(program)))
    assert list(leaves(after))[3] == slot(12.0, CORNERS[2])


def test_drawn_holes_of_other_sections_are_no_fellows():
    holes = [
        slot(12.0, CORNERS[0]),
        slot(12.0, CORNERS[1], (0.0, 0.0, 0.0), circle(0.5)),
        cylinder(4, 12, CORNERS[2]),
        slot(12.0, CORNERS[3]),
    ]
    program = cut(PLATE, *holes)
    assert regularise_outliers(program, 1e-3, lambda _: pytest.fail("no three are equal")) == program
