"""Whole parts whose mesh is a hair off what was typed: moved by microns, or in inches with rough numbers. The typed numbers come back."""

from itertools import pairwise

import numpy as np
import pytest
import trimesh
from tests.numbers.test_inches import plate
from tests.numbers.test_snap import disturbed
from tests.planted import box, cut, cylinder, mesh_of, union

from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.numbers.origin import find_offset
from imdim.program.motions import move_program, step
from imdim.program.tree import Program, leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct_best

BRACKET = cut(
    union(box(60, 40, 20, (0, 0, 10)), box(20, 40, 35.5, (-20, 0, 37.5))),
    cylinder(4.25, 20, (18, 0, 10)),
)
MOVED = (3e-3, -2e-3, 1e-3)


def moved(program: Program, by: tuple[float, float, float]) -> Program:
    return move_program(program, step(by))


def numbers_of(program: Program) -> np.ndarray:
    return np.array([v for leaf in leaves(program) for v in (*leaf.size, *leaf.center)])


def test_a_part_that_was_moved_by_microns_has_its_numbers_on_the_grid_again():
    mesh = mesh_of(moved(BRACKET, MOVED))
    mesh.vertices = mesh.vertices.astype(np.float32)
    found = reconstruct_best(mesh, Settings(evolution=False))
    numbers = numbers_of(found.program)
    assert np.abs(numbers - np.round(numbers / 0.025) * 0.025).max() < 1e-9  # of faces on a grid of 0.05 the middles
    assert volume_iou(to_manifold(found.program), mesh_to_manifold(mesh)) > 1 - 5e-4


def test_what_is_moved_is_told_by_all_places_of_an_axis():
    assert find_offset(list(leaves(moved(BRACKET, MOVED))), 0.01) == pytest.approx(MOVED, abs=1e-12)
    assert find_offset(list(leaves(moved(BRACKET, (1e-3, 0.02, 0.0)))), 0.01) == pytest.approx((1e-3, 0, 0), abs=1e-12)
    assert find_offset(list(leaves(BRACKET)), 0.01) == (0, 0, 0)


def test_one_odd_place_of_five_hides_no_origin():
    """A cover that was moved by microns, one of whose walls was never on a grid."""
    places = [0.0, 2.0, 7.0, 9.0, 10.9695507]
    walls = [box(b - a, 30.0, 20.0, ((a + b) / 2 + 0.001839, 15.0, 10.0)) for a, b in pairwise(places)]
    assert find_offset(walls, 0.01) == pytest.approx((0.001839, 0, 0), abs=1e-9)


def test_thousandths_that_a_mesh_tells_come_back():
    """A tray with pockets, whose walls nobody would have noticed a hundredth away: relations and repeats do not move them either."""
    pockets = [box(36.668, 17.4, 51.846, (x, y, 28.123)) for x in (20.734, 59.802, 98.87) for y in (11.1, 30.9)]
    tray = cut(box(119.604, 42.0, 53.046, (59.802, 21.0, 26.523)), *pockets)
    mesh = mesh_of(tray)
    mesh.vertices = mesh.vertices.astype(np.float32)
    parts = leaves(reconstruct_best(mesh, Settings(evolution=False)).program)
    walls = {round(leaf.center[0] + side * leaf.size[0] / 2, 9) for leaf in parts for side in (-1, 1)}
    assert walls == {0.0, 2.4, 39.068, 41.468, 78.136, 80.536, 117.204, 119.604}


def test_places_from_anywhere_tell_of_no_origin():
    rng = np.random.default_rng(3)
    for count in (2, 6, 30):
        for _ in range(10):
            parts = [box(*rng.uniform(1, 40, 3), tuple(rng.uniform(-40, 40, 3))) for _ in range(count)]
            assert find_offset(parts, 0.01) == (0, 0, 0)
    one = [box(10, 10, 10, (0.003, 0, 0)), *(box(10, 10, 10, (20.0 * i, 0, 0)) for i in (1, 2, 3))]
    assert find_offset(one, 0.01) == (0, 0, 0)


def test_an_odd_place_that_the_surface_bears_out_stays():
    """By 0.05 of 60 a thin plate is not moved to a grid."""
    thin = mesh_of(moved(box(60, 40, 1.0), (0.0, 0.0, 0.007)))
    (leaf,) = leaves(reconstruct_best(thin, Settings(evolution=False)).program)
    assert leaf.center[2] == pytest.approx(0.007, abs=1e-9)


def test_bodies_that_touch_are_not_moved_apart():
    """Of two bodies each would be told where it was, and one of them may bear no move."""
    low, high = moved(box(40, 30, 20), (0.0, 0.0, 3e-3)), moved(box(40, 30, 0.5, (0, 0, 20.25)), (0.0, 0.0, 3e-3))
    found = reconstruct_best(trimesh.util.concatenate([mesh_of(low), mesh_of(high)]), Settings(evolution=False))
    assert sorted(leaf.center[2] for leaf in leaves(found.program)) == pytest.approx([3e-3, 20.253], abs=1e-9)


def test_a_rough_plate_in_inches_comes_back_in_fractions():
    found = reconstruct_best(mesh_of(disturbed(plate(), 1e-3, 0.0)), Settings(evolution=False))
    got, typed = (sorted((leaf.kind, *leaf.size[:1], *leaf.center[:2]) for leaf in leaves(p)) for p in (found.program, plate()))
    for a, b in zip(got, typed, strict=True):
        assert a[1:] == pytest.approx(b[1:], abs=1e-9)
    assert next(leaf for leaf in leaves(found.program) if leaf.kind == "box").size == pytest.approx((76.2, 50.8, 12.7), abs=1e-9)
