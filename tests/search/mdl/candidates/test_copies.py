"""Copies of a part: even rows among what each place would gain, images with the same drawing, and a grid of holes out of one."""

from dataclasses import replace

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, union

from imdim.deadline import NEVER
from imdim.geometry.kernels import program_sdf
from imdim.geometry.sampling import surface_points
from imdim.numbers.em import maximise_likelihood
from imdim.numbers.likelihood import Noise
from imdim.numbers.ties import have_same_shape
from imdim.program.motions import mirror
from imdim.program.outline import Outline, circle, rectangle
from imdim.program.tree import Primitive, leaves
from imdim.search.mdl.candidates.copies import CopyPlaces, _image, find_rows
from imdim.search.mdl.candidates.drawn import take_holes_apart, take_loops_apart
from imdim.search.mdl.search import shorten

SHEARED = Outline((((0.0, 0.0, 0.0), (6.0, 0.0, 0.0), (4.0, 3.0, 0.3), (1.0, 2.0, 0.0)),))


def test_a_row_goes_on_as_far_as_its_copies_gain_something():
    gain = np.full(40, -1.0)
    gain[[3, 10, 17, 24, 31]] = 2.0  # every seventh place, from the middle one
    (step, before, behind), *_ = find_rows(gain, 17, 3, 0.5)
    assert (step, before, behind) == (7.0, 2, 2)
    gain[24], gain[25] = -1.0, 2.0  # a place beside an even one says how far apart they are
    (step, before, behind), *_ = find_rows(gain, 17, 3, 0.5)
    assert (before, behind) == (2, 2)
    assert 7.0 < step < 7.2
    assert find_rows(np.full(40, -1.0), 17, 3, 0.5) == []
    assert all(step >= 8 for step, _, _ in find_rows(gain, 17, 8, 0.5))


@pytest.mark.parametrize(
    ("kind", "size"), [("extrude", (4.0,)), ("revolve", (360.0,)), ("box", (2.0, 3.0, 4.0)), ("cone", (1.0, 2.0, 3.0))]
)
@pytest.mark.parametrize("normal", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, 0.8)])
def test_an_image_is_the_mirrored_solid_with_the_same_shape(kind, size, normal):
    outline = {"extrude": SHEARED, "revolve": SHEARED.shift(2.0, 0.0)}.get(kind)
    part = Primitive(kind, size, (5.0, 1.0, -2.0), (20.0, -35.0, 50.0), outline)
    image = _image(part, mirror((1.0, 0.0, 2.0), normal))
    assert have_same_shape(part, image, 1e-12)
    points = np.random.default_rng(0).uniform(-12, 12, (300, 3))
    n = np.array(normal)
    mirrored = points - 2 * ((points - (1.0, 0.0, 2.0)) @ n)[:, None] * n
    assert program_sdf(image, points) == pytest.approx(program_sdf(part, mirrored), abs=1e-9)


def test_copies_go_where_those_of_a_neighbour_are_and_about_what_is_round():
    posts = [cylinder(2, 10, (x, 5.0, 8.0)) for x in (-20.0, 0.0, 20.0)]
    program = union(box(60, 30, 6), *posts)
    points = surface_points(program, 2000, np.random.default_rng(0))[0]
    places = CopyPlaces.of(program, points, np.eye(3), 0.3, 2.0)
    cap = cylinder(3, 2, (0.0, 5.0, 13.0))
    found = [{tuple(np.round(p.center, 6)) for p in copies} for copies in places.sets(cap)]
    assert {(-20.0, 5.0, 13.0), (20.0, 5.0, 13.0)} in found
    turned = union(cylinder(20, 4), cylinder(2, 10, (12.0, 0.0, 0.0)))
    places = CopyPlaces.of(turned, surface_points(turned, 2000, np.random.default_rng(0))[0], np.eye(3), 0.3, 2.0)
    rings = [copies for copies in places.sets(cylinder(2, 10, (12.0, 0.0, 0.0))) if len(copies) == 5]
    assert any(np.allclose(np.linalg.norm([p.center[:2] for p in ring], axis=1), 12.0) for ring in rings)


def test_one_hole_becomes_a_grid_of_them():
    rng = np.random.default_rng(0)
    places = [(x, y) for x in (-12.0, 0.0, 12.0) for y in (-5.0, 5.0)]
    truth = cut(box(36, 22, 4), union(*(cylinder(1.2, 12, (x, y, 0.0)) for x, y in places)))
    points = surface_points(truth, 4000, rng)[0] + rng.normal(0, 0.25, (4000, 3))
    start = maximise_likelihood(cut(box(36, 22, 4), cylinder(1.2, 12, (0.0, 5.0, 0.0))), points, Noise(0.25))
    found, _ = next(shorten(start, points, [], np.eye(3), NEVER, copies=True))
    holes = [p for p in leaves(found.program) if p.kind == "cylinder"]
    assert len(holes) == 6
    assert np.ptp([p.size[0] for p in holes]) < 1e-6
    assert sorted((round(p.center[0] / 12), round(p.center[1] / 5)) for p in holes) == sorted(
        (round(x / 12), round(y / 5)) for x, y in places
    )


def test_holes_of_a_drawing_become_cuts_of_their_own():
    nearly = ((3.0, 2.0, 0.0), (3.1, -2.0, 0.0), (-1.0, -2.1, 0.0), (-1.0, 2.0, 0.0))
    leaf = Primitive("extrude", (5.0,), (1.0, 2.0, 3.0), outline=Outline((*rectangle(30.0, 20.0).loops, nearly, circle(2.0, 10.0, 5.0))))
    body, holes = take_holes_apart(leaf, 1.0)
    assert body == replace(box(30, 20, 5), center=(1.0, 2.0, 3.0))
    assert sorted(p.kind for p in holes) == ["box", "cylinder"]
    assert {p.size[-1] for p in holes} == {7.0}
    apart = Primitive("extrude", (5.0,), outline=Outline((rectangle(4.0, 4.0).shift(-9.0, 0.0).loops[0], circle(2.0, 5.0, 0.0))))
    assert sorted(p.kind for p in take_loops_apart(apart)) == ["box", "cylinder"]
    assert take_loops_apart(leaf) == [leaf]
    assert take_holes_apart(apart, 1.0) == (apart, [])  # islands are no holes
    assert take_holes_apart(box(3, 3, 3), 1.0) == (box(3, 3, 3), [])
