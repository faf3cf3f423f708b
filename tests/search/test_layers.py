"""Bodies in layers are read off their sections."""

import math

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, FillRule, Manifold

from imdim.geometry.solid import mesh_to_manifold, to_manifold, to_trimesh, volume_iou
from imdim.program.cost import count
from imdim.program.tree import leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct_best
from imdim.search.layers import Layers, draw_layers, find_layers
from imdim.target.target import Target, in_unit_frame, target_from

CORNERS, HEIGHT = 60, 3.0


def traced(seed: int, size: float) -> CrossSection:
    """A closed line of many corners, as one traces by hand."""
    rng = np.random.default_rng(seed)
    turns = (np.arange(CORNERS) + 0.6 * rng.random(CORNERS)) * 2 * math.pi / CORNERS
    radii = size * (1 + 0.25 * rng.random(CORNERS))
    return CrossSection([np.column_stack([radii * np.cos(turns), radii * np.sin(turns)])], FillRule.EvenOdd)


def stack() -> trimesh.Trimesh:
    """Two traced plates, the smaller one with a hole on the larger one."""
    low = traced(1, 20.0).extrude(HEIGHT)
    high = (traced(2, 12.0) - CrossSection.circle(4.0, 48)).extrude(HEIGHT).translate((0, 0, HEIGHT))
    return to_trimesh(low + high)


def layers_of(target: Target) -> Layers | None:
    mesh = in_unit_frame(target)[0].mesh
    assert mesh is not None
    return find_layers(np.asarray(mesh.face_normals), np.asarray(mesh.area_faces), mesh_to_manifold(mesh))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_layers_of_a_stack(axis: int) -> None:
    mesh = trimesh.Trimesh(np.roll(stack().vertices, axis - 2, axis=1), stack().faces)
    unit, _ = in_unit_frame(target_from(mesh))
    layers = layers_of(target_from(mesh))
    assert layers is not None
    assert len(layers.sections) == 2
    program = draw_layers(layers, 1e-5, 1e-6, 1e-8)
    assert program is not None
    assert unit.mesh is not None
    assert volume_iou(to_manifold(program), mesh_to_manifold(unit.mesh)) > 0.999
    assert [leaf.kind for leaf in leaves(program)] == ["extrude"] * 2


def test_a_boss_begins_where_its_plate_does_and_a_film_is_not_worth_a_feature() -> None:
    plate = (
        Manifold.cube((30, 20, 4)) + Manifold.cube((10, 10, 8)).translate((5, 5, 0)) + Manifold.cube((29.9, 20, 0.01)).translate((0, 0, 4))
    )
    layers = layers_of(target_from(to_trimesh(plate)))
    assert layers is not None
    whole = sum(section.area() * high for section, high in zip(layers.sections, np.diff(layers.levels), strict=True))
    program = draw_layers(layers, 1e-4, 2.5e-4 * whole, 2.5e-5 * whole)
    assert program is not None
    assert count(program).kinds["box"] == 2
    heights = sorted(leaf.size[2] for leaf in leaves(program))
    assert heights[1] == pytest.approx(2 * heights[0], rel=1e-2)


@pytest.mark.parametrize("solid", [Manifold.sphere(5.0, 32), Manifold.cylinder(8.0, 5.0, 3.0, 32)], ids=["a ball", "a cone"])
def test_what_slants_is_in_no_layers(solid: Manifold) -> None:
    assert layers_of(target_from(to_trimesh(solid))) is None


def test_more_walls_than_an_arrangement_holds_are_drawn_layer_by_layer() -> None:
    mesh = stack()
    found = reconstruct_best(target_from(mesh), Settings(budget_s=40))
    assert count(found.program).primitives <= 3
    assert volume_iou(to_manifold(found.program), mesh_to_manifold(mesh)) > 0.995
    assert found.seconds < 20
