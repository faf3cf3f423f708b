"""The edges of solids whose edges can be counted."""

from imdim.geometry.solid_edges import FacedSolid
from imdim.program.edges import Face
from imdim.program.outline import Outline
from imdim.program.tree import Combine, Primitive

PLATE = Primitive("box", (40.0, 30.0, 6.0))


def edges(program) -> set[frozenset[str]]:
    return {frozenset(map(str, pair)) for pair in FacedSolid.of(program).edges()}


def test_a_box_has_twelve():
    assert len(edges(PLATE)) == 12
    assert frozenset({"0.+x", "0.+z"}) in edges(PLATE)


def test_a_boss_meets_its_plate_in_a_foot_and_ends_in_a_rim():
    found = edges(Combine("union", PLATE, Primitive("cylinder", (5.0, 10.0), (0.0, 0.0, 8.0))))
    assert len(found) == 14
    assert {frozenset({"0.+z", "1.side"}), frozenset({"1.+z", "1.side"})} <= found


def test_a_hole_has_two_rims_and_none_in_the_air():
    found = edges(Combine("difference", PLATE, Primitive("cylinder", (5.0, 10.0))))
    assert len(found) == 14
    assert {frozenset({"0.+z", "1.side"}), frozenset({"0.-z", "1.side"})} <= found


def test_faces_that_touch_are_no_edge():
    """Round corners of an outline go over into its walls."""
    corner = 0.41421356237309503
    loop = ((-20.0, -15.0, 0.0), (15.0, -15.0, corner), (20.0, -10.0, 0.0), (20.0, 15.0, 0.0), (-20.0, 15.0, 0.0))
    found = edges(Primitive("extrude", (6.0,), outline=Outline((loop,))))
    assert len(found) == 13  # ten rims and three sharp corners
    assert Face(0, "wall[0][1]") not in {face for pair in found for face in pair if "z" not in "".join(pair)}
