"""The variants of a part bound the same solid, up to a similarity, and differ where they are meant to."""

import importlib
import sys
from pathlib import Path

import pytest
import trimesh
from tests.planted import box, cut, cylinder, mesh_of

from imdim.geometry.solid import mesh_to_manifold
from imdim.reconstruction.config import Settings
from imdim.target.target import target_from

sys.path.append(str(Path(__file__).parents[2] / "scripts" / "bench"))
equivariance = importlib.import_module("equivariance")
PART = mesh_of(cut(box(20, 10, 4), cylinder(3, 10, (4.0, 1.0, 0.0))), 24)


@pytest.mark.parametrize("name", equivariance.VARIANTS)
def test_a_variant_is_the_same_solid(name):
    made = equivariance.VARIANTS[name](PART)
    scale = 1000.0 if name == "scaled" else 1.0
    assert mesh_to_manifold(made).volume() == pytest.approx(PART.volume * scale**3, rel=1e-6)
    assert made.area == pytest.approx(PART.area * scale**2, rel=1e-6)


def test_faces_are_as_many_as_meant():
    fine = equivariance.VARIANTS["subdivided"](PART)
    assert len(fine.faces) == 4 * len(PART.faces)
    assert len(equivariance.decimate(fine).faces) == len(PART.faces)


def test_a_block_gives_the_same_answer_in_every_variant():
    block = mesh_of(box(20, 10, 4))
    settings = Settings(budget_s=20.0)
    for make in equivariance.VARIANTS.values():
        found = equivariance.answer(make(block), settings)
        assert (found.features, found.iou) == (1, pytest.approx(1.0, abs=1e-6))


def test_flat_faces_that_were_divided_are_merged_and_told():
    plain, fine = (target_from(mesh) for mesh in (PART, equivariance.VARIANTS["subdivided"](PART)))
    assert plain.notes == ()
    assert fine.notes == (f"{4 * len(PART.faces)} faces merged to {len(PART.faces)}: the others divided flat ones.",)
    assert len(fine.mesh.faces) == len(plain.mesh.faces)
    assert fine.mesh.volume == pytest.approx(plain.mesh.volume, rel=1e-9)


def test_fine_faces_of_a_round_part_stay():
    ball = trimesh.creation.icosphere(4)
    assert len(target_from(ball).mesh.faces) == len(ball.faces)
