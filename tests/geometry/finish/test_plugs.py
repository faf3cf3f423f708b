"""Tubes that plug a hole: a boss with a bore. Rods that do: two holes."""

import pytest
from tests.deadlines import PASSED
from tests.planted import ALONG_Y, box, cut, cylinder, union

from imdim.geometry.finish.plugs import bore_plugs, part_holes
from imdim.geometry.solid import symmetric_difference_volume, to_manifold, volume_iou
from imdim.program.outline import Outline
from imdim.program.tree import Primitive, leaves

RING = cut(cylinder(40, 30), cylinder(30, 40))
ACROSS = (0.0, 90.0, 0.0)
HOLE = Primitive("cylinder", (8.0, 20.0), (35.0, 0.0, 0.0), ACROSS)


def tube(radius, x=34.0):
    """13 long, with a counterbore at its inner end."""
    ring = ((6.0, -6.5), (radius, -6.5), (radius, 6.5), (4.0, 6.5), (4.0, -3.5), (6.0, -3.5))
    return Primitive("revolve", (360.0,), (x, 0.0, 0.0), ACROSS, Outline((tuple((r, z, 0.0) for r, z in ring),)))


def kinds(program):
    return sorted(leaf.kind for leaf in leaves(program))


def test_a_tube_in_a_hole_as_wide_is_a_boss_with_a_bore():
    program = union(cut(RING, HOLE), tube(8.0))
    solid = to_manifold(program)
    bored = bore_plugs(program, solid)
    assert kinds(bored) == ["cylinder", "cylinder", "cylinder", "revolve"]
    boss, bore = list(leaves(bored))[-2:]
    assert (boss.kind, boss.size) == ("cylinder", (8.0, 13.0))
    assert volume_iou(to_manifold(bored), solid) > 1 - 1e-6
    assert {x for x, _, _ in bore.outline.loops[0]} == {0.0, 4.0, 6.0}


def test_a_tube_that_is_narrower_or_that_leaves_some_of_the_hole_stays():
    for other in (tube(7.5), tube(8.0, 39.0)):
        program = union(cut(RING, HOLE), other)
        assert bore_plugs(program, to_manifold(program)) is program
    program = union(cut(RING, HOLE), tube(8.0))
    assert bore_plugs(program, to_manifold(program), PASSED) is program


def test_each_plug_is_decided_by_itself_where_all_cannot_be_one():
    other = Primitive("cylinder", (8.0, 20.0), (-35.0, 0.0, 0.0), ACROSS)
    program = union(cut(RING, HOLE, other), tube(8.0), tube(8.0, -31.0))
    bored = bore_plugs(program, to_manifold(program))
    assert kinds(bored).count("revolve") == 2
    assert len(list(leaves(bored))) == len(list(leaves(program)))
    assert tube(8.0, -31.0) in leaves(bored)
    assert tube(8.0) not in leaves(bored)


def test_a_rod_in_a_hole_makes_two_holes_of_it() -> None:
    block, hole, rod = box(20, 60, 12), cylinder(2.5, 62, rotation=ALONG_Y), cylinder(2.5, 6, (0.0, 1.0, 0.0), ALONG_Y)
    program = union(cut(block, hole), rod)
    parted = part_holes(program, to_manifold(program))
    depths = sorted(leaf.size[1] for leaf in leaves(parted) if leaf.kind == "cylinder")
    assert depths == pytest.approx([27.0, 29.0])
    assert symmetric_difference_volume(to_manifold(parted), to_manifold(program)) < 1e-6
    assert part_holes(program, to_manifold(program), PASSED) is program


@pytest.mark.parametrize(
    "rod",
    [
        cylinder(2.5, 30, (0.0, 20.0, 0.0), ALONG_Y),  # it makes the hole a blind one
        cylinder(2.0, 6, (0.0, 1.0, 0.0), ALONG_Y),  # it leaves a slit
        cylinder(2.5, 6, (1.0, 1.0, 0.0), ALONG_Y),  # beside
    ],
)
def test_what_does_not_part_a_hole_stays(rod) -> None:
    program = union(cut(box(20, 60, 12), cylinder(2.5, 62, rotation=ALONG_Y)), rod)
    assert part_holes(program, to_manifold(program)) is program
