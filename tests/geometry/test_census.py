"""Bodies, through-holes and voids of solids that say how many they have."""

import pytest
from manifold3d import Manifold

from imdim.geometry.census import census_of, find_pieces, split_surfaces
from imdim.geometry.solid import to_trimesh

CUBE, BALL, PIN = Manifold.cube([10, 10, 10], True), Manifold.sphere(3, 32), Manifold.cylinder(20, 2, 2, 32, True)


@pytest.mark.parametrize(
    ("solid", "kind"),
    [
        (CUBE, (1, 0, 0)),
        (CUBE - PIN, (1, 1, 0)),
        (CUBE - PIN - PIN.rotate([90, 0, 0]), (1, 3, 0)),
        (CUBE - BALL, (1, 0, 1)),
        ((CUBE - BALL) + Manifold.sphere(1, 32), (2, 0, 1)),
        (CUBE + (CUBE - PIN).translate([20, 0, 0]), (2, 1, 0)),
        (CUBE + Manifold.cube([1e-3, 1e-3, 1e-3]).translate([20, 0, 0]), (1, 0, 0)),
    ],
)
def test_kinds(solid, kind):
    assert census_of(solid).kind == kind


def test_sizes():
    census = census_of(CUBE + CUBE.translate([20, 0, 0]))
    assert census.size == pytest.approx((30, 10, 10))
    assert census.volume == pytest.approx(2000)


def test_surfaces_are_split_as_they_come_with_their_own_corners():
    """As manifold3d would, of which a solid of some thousand bodies takes half a minute."""
    row = sum((CUBE.translate([20 * i, 0, 0]) for i in range(1, 5)), CUBE - PIN)
    mesh = to_trimesh(row)
    split = split_surfaces(mesh)
    assert sum(len(piece.faces) for piece in split) == len(mesh.faces)
    assert sum(len(piece.vertices) for piece in split) == len(mesh.vertices)
    assert all(piece.is_watertight for piece in split)
    assert sorted(piece.volume for piece in split) == pytest.approx(sorted(piece.volume() for piece in row.decompose()))
    assert split_surfaces(split[0]) == [split[0]]


def test_pieces_are_the_surfaces_that_enclose_enough():
    crumb = Manifold.cube([1e-3, 1e-3, 1e-3]).translate([20, 0, 0])
    part = (CUBE - BALL) + CUBE.translate([0, 20, 0]) + crumb
    pieces = find_pieces(part, 1e-6)
    assert sorted(piece.volume() for piece in pieces) == pytest.approx([-BALL.volume(), 1000, 1000])
    assert sorted(piece.num_vert() for piece in pieces) == [8, 8, BALL.num_vert()]
    assert len(find_pieces(part, 0.0)) == len(part.decompose()) == 4
    assert [piece.volume() for piece in find_pieces(CUBE, 999)] == pytest.approx([1000])
    assert find_pieces(CUBE, 1001) == []


def test_nothing_has_no_bodies():
    assert census_of(Manifold()).kind == (0, 0, 0)
    assert find_pieces(Manifold(), 0.0) == []
