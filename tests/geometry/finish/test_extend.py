"""Prolonged primitives against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from imdim.geometry.finish.extend import apex, between, beyond, flip_face, plane_faces, within
from imdim.geometry.solid import bounds_of, to_manifold
from imdim.program.outline import Outline, circle
from imdim.program.tree import FLAT_ENDS, KINDS, OUTLINED, Primitive

TILT = (30.0, 20.0, 10.0)
CONE = Primitive("cone", (4.0, 1.0, 3.0))
SIZES = {
    "box": (2.0, 3.0, 4.0),
    "sphere": (1.0,),
    "cylinder": (1.0, 2.0),
    "cone": (4.0, 1.0, 3.0),
    "torus": (2.0, 0.5),
    "ellipsoid": (1.0, 2.0, 3.0),
    "extrude": (2.0,),
    "revolve": (360.0,),
    "drafted": (2.0, 5.0),
}
OUTLINE = Outline((((0.2, -1.0, 0.0), (1.0, -1.0, 0.4), (0.8, 1.0, 0.0), (0.2, 1.0, -0.3)), circle(0.1, 0.8)))


def sized(kind, center=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0)):
    outlines = dict.fromkeys(OUTLINED, OUTLINE) | {"drafted": Outline((circle(2.0),))}
    return Primitive(kind, SIZES[kind], center, rotation, outlines.get(kind))


FACED = [sized(kind, (1.0, 2.0, 3.0), TILT) for kind in ("box", "cylinder", "cone", "extrude")]


@pytest.mark.parametrize("kind", KINDS)
def test_plane_faces_are_counted(kind):
    assert len(list(plane_faces(sized(kind)))) == {"box": 6, "cylinder": 2, "cone": 2, "extrude": 2}.get(kind, 0)


def test_walls_with_a_draft_keep_their_slope():
    square = ((-2.0, -2.0, 0.0), (2.0, -2.0, 0.0), (2.0, 2.0, 0.0), (-2.0, 2.0, 0.0))
    leaf = Primitive("drafted", (2.0, 45.0 / 2), outline=Outline((square,)))
    whole = to_manifold(leaf)
    lower = between(leaf, (2, 1), -2.0, -0.5)
    assert lower.outline == leaf.outline
    assert lower.size == (1.5, 22.5)
    upper = between(leaf, (2, -1), -2.0, -0.5)
    assert upper.center == (0.0, 0.0, 0.25)
    assert (to_manifold(upper) - whole).volume() < 1e-9
    assert to_manifold(lower).volume() + to_manifold(upper).volume() > whole.volume()
    deeper = between(leaf, (2, -1), -2.0, 0.5)
    assert deeper.center == (0.0, 0.0, -0.25)
    assert (whole - to_manifold(deeper)).volume() < 1e-9
    with pytest.raises(ValueError, match="vanishes"):
        between(leaf, (2, 1), -2.0, 9.0)


def test_an_apex_is_no_face():
    assert list(plane_faces(Primitive("cone", (0.0, 1.0, 3.0)))) == [(2, 1)]


def test_a_cone_keeps_its_slope_and_ends_at_its_apex():
    assert between(CONE, (2, 1), -3.0, 0.5).size == (4.0, 0.5, 3.5)
    assert between(CONE, (2, 1), -3.0, 9.0) == Primitive("cone", (4.0, 0.0, 4.0), (0.0, 0.0, 0.5))
    assert between(CONE, (2, -1), -3.0, 1.0) == Primitive("cone", (5.0, 1.0, 4.0), (0.0, 0.0, -0.5))
    assert (apex(CONE, (2, 1)), apex(CONE, (2, -1))) == (1.0, math.inf)


@pytest.mark.parametrize("leaf", FACED, ids=lambda p: p.kind)
def test_what_is_prolonged_is_the_primitive_and_the_piece_beyond(leaf):
    for face in plane_faces(leaf):
        depth = leaf.size[face[0]] if leaf.kind == "box" else leaf.size[-1]
        whole, piece = (to_manifold(between(leaf, face, low, 0.5)) for low in (-depth, 0.0))
        assert (whole - (to_manifold(leaf) + piece)).volume() < 1e-6 * whole.volume()
        assert (to_manifold(leaf) ^ piece).volume() < 1e-6 * whole.volume()


@pytest.mark.parametrize("leaf", FACED, ids=lambda p: p.kind)
def test_regions_lie_on_their_side_of_the_face(leaf):
    for face in plane_faces(leaf):
        inner, outer = to_manifold(within(leaf, face, 0.01)), to_manifold(beyond(leaf, face, 0.01, 0.5))
        assert (inner - to_manifold(leaf)).volume() < 1e-9
        assert inner.volume() > 0
        assert (outer ^ to_manifold(leaf)).volume() < 1e-9
        assert outer.volume() > 0


def test_a_mirror_image_is_turned_about_x():
    assert [flip_face(face) for face in [(0, 1), (1, -1), (2, 1)]] == [(0, -1), (1, -1), (2, 1)]


@pytest.mark.parametrize("kind", FLAT_ENDS)
def test_the_table_of_plane_ends_has_the_length_between_each_two(kind):
    leaf = sized(kind)
    for axis, column in FLAT_ENDS[kind].items():
        longer = replace(leaf, size=tuple(s + (i == column) for i, s in enumerate(leaf.size)))
        grown = np.ptp(bounds_of(to_manifold(longer)), axis=0) - np.ptp(bounds_of(to_manifold(leaf)), axis=0)
        assert grown == pytest.approx(np.eye(3)[axis])
