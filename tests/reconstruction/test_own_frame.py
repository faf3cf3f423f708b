"""A part gives the same program wherever it lies: what lies aslant is reconstructed along its own axes."""

import numpy as np
import pytest
import trimesh
from tests.planted import box, cone, cut, cylinder, mesh_of, union

from imdim.detection.blends import Blend, Chain
from imdim.geometry.rotations import turn_about
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.geometry.surface import Surface, signed_distance
from imdim.program.tree import leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.edge_features import place_chain
from imdim.reconstruction.own_frame import find_own_frame, turn_back
from imdim.reconstruction.pipeline import reconstruct_best
from imdim.target.target import target_from

ODD = turn_about(np.array([1.0, 2.0, 3.0]) / 14**0.5, np.radians(30))
SOCKET = cut(
    union(cylinder(39.95, 2, center=(0, 0, 1)), cylinder(36.95, 10, center=(0, 0, 5)), cone(36.95, 35, 5, center=(0, 0, 12.5))),
    cylinder(30, 40),
)


def aslant(program):
    mesh = mesh_of(program)
    return trimesh.Trimesh(mesh.vertices @ ODD.T, mesh.faces, process=False)


def sizes(program):
    return sorted((leaf.kind, tuple(round(s, 6) for s in leaf.size)) for leaf in leaves(program))


def test_a_part_that_lies_aslant_has_the_sizes_that_it_has_upright():
    mesh = aslant(SOCKET)
    upright, turned = (reconstruct_best(m, Settings(budget_s=20)).program for m in (mesh_of(SOCKET), mesh))
    assert sizes(turned) == sizes(upright)
    assert volume_iou(to_manifold(turned, 768), mesh_to_manifold(mesh)) > 0.99


def test_programs_turn_there_and_back():
    own = find_own_frame(target_from(aslant(SOCKET)))
    assert own is not None
    mesh = own.normalise(target_from(aslant(SOCKET))).mesh
    assert mesh is not None
    assert volume_iou(to_manifold(own.apply(turn_back(SOCKET, own)), 768), to_manifold(SOCKET, 768)) == pytest.approx(
        1, abs=1e-4
    )  # facets begin elsewhere
    assert volume_iou(mesh_to_manifold(mesh), mesh_to_manifold(mesh_of(SOCKET))) == pytest.approx(1, abs=1e-3)


def test_blends_turn_with_their_faces():
    own = find_own_frame(target_from(aslant(cut(box(40, 30, 4), cylinder(3, 9)))))
    assert own is not None
    corners = np.array([[1.0, 2.0, 3.0], [1.0, -2.0, 0.0]])
    wall = Surface("cylinder", (1.0, 2.0, 0.0), (0.0, 0.0, 1.0), (2.0,))
    chain = place_chain(Chain((Blend("fillet", (2.0,), 1, np.arange(2), corners, wall, (wall,)),)), own)
    turned = chain.blends[0]
    assert np.allclose(signed_distance(turned.carrier, turned.corners), signed_distance(wall, corners))
    assert np.allclose(turned.corners, corners @ ODD.T)
