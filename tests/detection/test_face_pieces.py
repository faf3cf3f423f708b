"""What stands on a face, or is sunk into it, is found with its depth, and a mesh without it is the plain part."""

import pytest
from manifold3d import CrossSection, Error, Manifold, OpType
from tests.lettered import box, draw_text, raise_on, sink_into

from imdim.detection.face_pieces import find_face_pieces, number_faces, without_pieces
from imdim.detection.facets import facets_of
from imdim.geometry.solid import symmetric_difference_volume, to_trimesh

PLATE = box(60, 40, 0, 6)
DISCS = CrossSection.circle(3, 24).translate((-15, 0)) + CrossSection.square((5, 9)).translate((0, 3))
RING = CrossSection.circle(6, 48) - CrossSection.circle(4, 48)


def find(solid: Manifold, least: int = 1):
    mesh = to_trimesh(solid)
    return mesh, list(find_face_pieces(mesh, facets_of(mesh), least))


@pytest.mark.parametrize(("make", "depth"), [(raise_on, 2.0), (sink_into, -2.0)])
@pytest.mark.parametrize("turn", [(0, 0, 0), (20, 35, 50)])
def test_pieces_are_found_and_taken_off(make, depth, turn):
    mesh, (face,) = find(make(PLATE, DISCS + RING.translate((18, -8)), 6, 2.0).rotate(turn), least=3)
    assert [piece.depth for piece in face.pieces] == pytest.approx([depth] * 3, abs=1e-9)
    assert sorted(len(piece.rims) for piece in face.pieces) == [1, 1, 2]
    bare = without_pieces(mesh, face.pieces)
    assert bare.status() == Error.NoError
    assert symmetric_difference_volume(bare, PLATE.rotate(turn)) < 1e-9 * PLATE.volume()
    assert without_pieces(mesh, face.pieces[:1]).genus() == bare.genus()


def test_what_goes_through_leans_or_is_rounded_is_no_piece():
    assert not find(PLATE - draw_text("LET").extrude(20).translate((0, 0, -5)))[1]
    for shape in (Manifold.cylinder(3, 5, 3, 24), Manifold.sphere(4, 24)):
        placed = [shape.translate((x, 0, 6)) for x in (-20, 0, 20)]
        assert not find(Manifold.batch_boolean([PLATE, *placed], OpType.Add))[1]


def test_pieces_that_a_hole_cuts_belong_to_the_rest():
    drilled = sink_into(PLATE, DISCS, 6, 2.0) - Manifold.cylinder(20, 2, 2, 32).translate((-15, 3, -5))
    mesh, (face,) = find(drilled)
    assert len(face.pieces) == 1
    assert without_pieces(mesh, face.pieces).genus() == 1


def test_faces_of_one_plane_are_one():
    solid = box(60, 40, 0, 6) + box(10, 10, 0, 10)
    facets = facets_of(to_trimesh(solid - box(4, 60, 3, 20)))
    face, areas = number_faces(facets)
    assert len(areas) == face.max() + 1
    up = [float(area) for number, area in enumerate(areas) if facets.normals[face == number][0] @ (0, 0, 1) > 0.9]
    assert sorted(up) == pytest.approx(sorted([60 * 40 - 40 * 4 - 6 * 10, 40 * 4, 6 * 10]))
