"""What a search leaves out of holes comes back from the cones that the mesh shows, and nothing else does."""

import math

import pytest
from tests.planted import box, cone, cut, cylinder, mesh_of

from imdim.detection.mesh_surfaces import detect_patches
from imdim.geometry.holes import find_holes
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.program.cost import count
from imdim.program.outline import Outline, circle
from imdim.program.tree import Primitive, Program, leaves, map_leaves, map_lengths
from imdim.reconstruction.hole_ends import complete_holes

TIP = 2.5 / math.tan(math.radians(59))
PLACES = [(-20.0, 0.0), (0.0, 0.0), (20.0, 0.0)]


def in_unit(program: Program) -> Program:
    """A hundredth of it, about the size that reconstruction works in."""
    return map_leaves(program, lambda _, leaf: map_lengths(leaf, lambda v: v / 100, tuple(c / 100 for c in leaf.center)))  # type: ignore[arg-type]


def completed(meant: Program, found: Program, weight: float = 0.0) -> tuple[Program, float, float]:
    """The program found with what is completed where a primitive costs `weight`, and its IoU with what is meant before and after."""
    mesh = mesh_of(in_unit(meant))
    solid = mesh_to_manifold(mesh)
    before = in_unit(found)

    def iou(program: Program) -> float:
        return volume_iou(to_manifold(program), solid)

    after = complete_holes(before, detect_patches(mesh), iou, lambda p: 1 - iou(p) + weight * count(p).primitives)
    return after, iou(before), iou(after)


def drilled() -> Program:
    profile = Outline((((0.0, -2.0 - TIP, 0.0), (2.5, -2.0, 0.0), (2.5, 9.0, 0.0), (0.0, 9.0, 0.0)),))
    return cut(box(60, 30, 12), *(Primitive("revolve", (360.0,), (x, y, 0.0), outline=profile) for x, y in PLACES))


FLAT = {
    "cylinders": [cylinder(2.5, 11 + TIP, (x, y, 3.5 - TIP / 2)) for x, y in PLACES],
    "one outline": [
        Primitive("extrude", (11 + TIP,), (0.0, 0.0, 3.5 - TIP / 2), outline=Outline(tuple(circle(2.5, x, y) for x, y in PLACES)))
    ],
    "from below": [Primitive("cylinder", (2.5, 11 + TIP), (x, y, 3.5 - TIP / 2), (180.0, 0.0, 0.0)) for x, y in PLACES],
}


@pytest.mark.parametrize("made", FLAT)
def test_the_points_of_drills_come_back(made):
    after, before, now = completed(drilled(), cut(box(60, 30, 12), *FLAT[made]))
    assert [h.kind for h in find_holes(after)] == ["drilled"] * 3
    assert all(h.depth == pytest.approx(0.08, rel=1e-3) for h in find_holes(after))
    assert now > before
    assert now > 1 - 1e-5


@pytest.mark.parametrize(("made", "kind"), [("cylinders", "drilled"), ("one outline", "blind")])
def test_points_that_are_not_worth_more_features_come_back_where_they_are_none(made, kind):
    after, _, _ = completed(drilled(), cut(box(60, 30, 12), *FLAT[made]), weight=0.01)
    assert [h.kind for h in find_holes(after)] == [kind] * 3


def test_seats_come_back_at_either_end():
    holes = [cylinder(2, 30, (x, y, 0.0)) for x, y in PLACES]
    seats = [cone(2, 4, 2, (-20.0, 0.0, 5.0)), cone(4, 2, 2, (20.0, 0.0, -5.0))]
    after, _, now = completed(cut(box(60, 30, 12), *holes, *seats), cut(box(60, 30, 12), *holes))
    assert sorted(h.kind for h in find_holes(after)) == ["countersink", "countersink", "through"]
    assert now > 1 - 1e-5


def test_what_is_whole_stays_as_it_is():
    after, _, _ = completed(drilled(), drilled())
    assert list(leaves(after)) == list(leaves(in_unit(drilled())))
