"""Faces on detected surfaces are told from those that are not."""

from dataclasses import replace

import numpy as np
import pytest
from tests.planted import PARTS, box, cone, cut, cylinder, ellipsoid, sphere, torus, union
from tests.search.planted_families import arrangement_of, planted, random_candidates

from imdim.program.outline import Outline, circle, rectangle
from imdim.program.tree import Primitive, leaves
from imdim.search.evolve.numbers import face_at
from imdim.search.front.face_support import DRIFTED, Carriers


@pytest.mark.parametrize("name", PARTS)
def test_the_drawn_primitives_and_all_candidates_are_explained(name):
    families = planted(name)
    carriers = Carriers(families.arrangement)
    for leaf in leaves(PARTS[name]):
        assert carriers.free_faces(leaf) == 0
    for candidate in random_candidates(families, 100, np.random.default_rng(0)):
        assert carriers.free_faces(families.primitive(candidate)) == 0


KINDS = union(
    box(20, 30, 40, rotation=(0.0, 0.0, 20.0)),
    cylinder(5, 60),
    cone(8, 4, 10, (30.0, 0.0, 0.0)),
    sphere(7, (0.0, 40.0, 0.0)),
    torus(9, 2, (0.0, 0.0, 50.0)),
    ellipsoid(9, 6, 4, (0.0, -50.0, 0.0), (10.0, 20.0, 30.0)),
)


@pytest.mark.parametrize("leaf", list(leaves(KINDS)), ids=lambda leaf: leaf.kind)
def test_every_changed_number_is_noticed(leaf):
    carriers = Carriers(arrangement_of(KINDS))
    assert carriers.free_faces(leaf) == 0
    for i in range(len(leaf.size)):
        grown = replace(leaf, size=tuple(s + 0.01 * (k == i) for k, s in enumerate(leaf.size)))
        assert carriers.free_faces(grown) > 0
    for i in range(3):
        x, y, z = (c + 0.01 * (k == i) for k, c in enumerate(leaf.center))
        # a cylinder may slide along its axis, but then both of its ends leave their planes
        assert carriers.free_faces(replace(leaf, center=(x, y, z))) > 0
    if leaf.kind != "sphere":
        rx, ry, rz = leaf.rotation
        assert carriers.free_faces(replace(leaf, rotation=(rx + 0.01, ry, rz))) > 0


def test_one_moved_face_is_one_free_face():
    plate = box(60, 28, 4)
    carriers = Carriers(planted("rounded plate").arrangement)
    moved = face_at(plate, 1, 1, 0, 0.3)
    assert moved is not None
    assert carriers.free_faces(moved) == 1


def test_a_wall_beside_a_detected_one_is_dearer_than_one_of_its_own():
    carriers = Carriers(planted("rounded plate").arrangement)
    beside, alone = cylinder(5.99, 4, (24.0, 14.0, 0.0)), cylinder(5.99, 4, (10.0, 14.0, 0.0))
    assert (carriers.free_faces(beside), carriers.free_faces(alone)) == (DRIFTED, 1)


def test_faces_of_outlines_that_lie_on_nothing_are_counted():
    """An extruded L with a hole is drawn on the surfaces of the boxes and the bore that it is; moved a little, its faces lie on nothing."""
    bored = cut(union(box(60, 10, 8, (30, 5, 0)), box(10, 40, 8, (5, 20, 0))), cylinder(2.75, 20, (50, 5, 0)))
    carriers = Carriers(arrangement_of(bored))
    corner = ((0.0, 0.0, 0.0), (60.0, 0.0, 0.0), (60.0, 10.0, 0.0), (10.0, 10.0, 0.0), (10.0, 40.0, 0.0), (0.0, 40.0, 0.0))
    drawn = Primitive("extrude", (8.0,), (30.0, 20.0, 0.0), (0.0, 0.0, 0.0), Outline((corner, circle(2.75, 50, 5))).shift(-30.0, -20.0))
    assert carriers.free_faces(drawn) == 0
    inset = replace(
        drawn, outline=Outline((tuple((x - 30.5 if x == 10 else x - 30, y - 20, b) for x, y, b in corner), drawn.outline.loops[1]))
    )
    assert carriers.free_faces(inset) == 1
    # of a bore that is a little too wide both halves count as drifted
    assert carriers.free_faces(replace(drawn, outline=Outline((corner, circle(2.8, 50, 5))).shift(-30.0, -20.0))) == 2 * DRIFTED
    assert carriers.free_faces(Primitive("revolve", (360.0,), (50.0, 5.0, 0.0), outline=rectangle(2.75, 8.0).shift(1.375, 0.0))) == 0
