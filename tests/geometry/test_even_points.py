"""Even points as compiled loops draw them: those of the maps that array operations follow, place by place."""

from dataclasses import replace

import numpy as np
import pytest
from tests.planted import PARTS, box, cone, cut, cylinder, sphere, union

from imdim.geometry import kernels
from imdim.geometry.even_points import GOLDEN, PLASTIC, draw_even
from imdim.geometry.point_grid import PointGrid, find_bounds
from imdim.geometry.sampling import even_surface, even_surfaces
from imdim.geometry.surface_map import map_surface
from imdim.geometry.swept_surface import draw_even_swept, sampling_areas
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, circle
from imdim.program.tree import Primitive

PLATE = Outline((((0.0, 0.0, 0.0), (6.0, 0.0, 0.4), (6.0, 4.0, 0.0), (0.0, 4.0, 0.0)), circle(1.0, 2.0, 2.0)))
OVAL = Outline((Ellipse(3.0, 1.0, 5.0, 0.0, 0.5),))
DRAWN = [
    Primitive("extrude", (2.0,), outline=PLATE),
    Primitive("extrude", (2.0,), outline=OVAL),
    Primitive("revolve", (360.0,), outline=OVAL),
    Primitive("revolve", (120.0,), outline=PLATE),
]
PLAIN = [
    box(3, 2, 5),
    cylinder(2, 3),
    cone(3, 1, 4),
    cone(0, 2, 3),
    sphere(2),
    Primitive("torus", (3.0, 1.0)),
    Primitive("ellipsoid", (1.0, 2.0, 3.0)),
]
N = 700


def lattice(areas, n):
    """The numbers of even places: where along its face a place is, from which face, and the golden ratio's multiples."""
    i = np.arange(n)
    first, bounds = (i + 0.5) / n, np.concatenate([[0.0], np.cumsum(areas) / np.sum(areas)])
    face = np.clip(np.searchsorted(bounds, first, side="right") - 1, 0, len(areas) - 1)
    return np.column_stack([first, (first - bounds[face]) / np.diff(bounds)[face], (i * GOLDEN) % 1.0]), (i * PLASTIC) % 1.0


def faces_of(part):
    if part.kind == "box":
        a, b, c = part.size
        return [b * c, c * a, a * b] * 2
    if part.kind in ("cylinder", "cone"):
        bottom, top, h = part.size if part.kind == "cone" else (part.size[0], part.size[0], part.size[1])
        return [bottom**2, top**2, (bottom + top) * np.hypot(bottom - top, h)]
    return None


@pytest.mark.parametrize("part", PLAIN, ids=lambda p: p.kind)
def test_places_on_a_primitive_are_those_of_its_map(part):
    areas = faces_of(part)
    u, chance = lattice([1.0] if areas is None else areas, N)
    if areas is None:
        u[:, 1] = u[:, 2]
    points, normals, share = map_surface(part, u)
    kept = chance < share
    found = draw_even([part], [N])
    assert found[0] == pytest.approx(points[kept], abs=1e-9)
    assert found[1] == pytest.approx(normals[kept], abs=1e-9)


@pytest.mark.parametrize("part", DRAWN, ids=lambda p: f"{p.kind} {p.size[0]:g} {len(p.outline.loops)}")
def test_places_on_a_drawn_solid_are_those_of_its_map(part):
    u, chance = lattice(sampling_areas(part.kind, part.size, part.outline), N)
    points, normals, share = map_surface(part, u)
    kept = chance < share
    found = draw_even_swept(part.kind, part.size, part.outline, N, (GOLDEN, PLASTIC))
    assert found[0] == pytest.approx(points[kept], abs=1e-9)
    assert found[1] == pytest.approx(normals[kept], abs=1e-9)


def test_many_are_drawn_as_each_alone():
    parts, counts = [PLAIN[5], DRAWN[0], PLAIN[0]], [200, 300, 100]
    points, normals, starts = even_surfaces(parts, counts)
    assert len(points) == starts[-1] == len(normals)
    for part, count, first, last in zip(parts, counts, starts, starts[1:], strict=False):
        assert (points[first:last] == even_surface(part, count)[0]).all()


def test_each_program_holds_what_it_holds_alone():
    rng = np.random.default_rng(0)
    parts = [*PARTS.values(), DRAWN[0], box(4, 5, 6), union(cut(DRAWN[3], sphere(3)), PLAIN[5])]
    points = rng.normal(0.0, 6.0, (5000, 3))
    alone = [kernels.program_sdf(part, points) < 0 for part in parts]
    assert (kernels.inside_each(parts, points) == alone).all()
    assert any(0 < held.mean() < 1 for held in alone)
    ranges = np.linspace(0, 5000, len(parts) + 1).astype(int)
    own = np.concatenate([held[a:b] for held, a, b in zip(alone, ranges, ranges[1:], strict=False)])
    assert (kernels.inside_each(parts, points, ranges) == own).all()
    assert kernels.inside_each([], points).shape == (0, 5000)


def test_what_lies_beside_a_part_is_told_without_a_look_at_it():
    """Points that lie near each other are ruled out together by a box about each leaf: no box may be too small."""
    rng = np.random.default_rng(1)
    turned = {"center": (1.0, -2.0, 0.5), "rotation": (25.0, -40.0, 70.0)}
    big = ((0.0, -2.0, 0.0), (1.0, -2.0, 3.0), (1.0, 2.0, 0.0), (0.0, 2.0, 0.0))  # an arc of more than half a turn
    low = ((2.0, -1.0, 0.0), (4.0, -1.0, 0.6), (4.0, 1.0, 0.0), (2.0, 1.0, -0.4))
    outlines = [Outline((big,)), Outline((low,)), Outline((Ellipse(3.0, 1.0, 3.5, 0.0, 30.0),))]
    drawn = [
        Primitive("extrude", (3.0,), outline=outlines[0], **turned),
        Primitive("extrude", (3.0,), outline=outlines[2], **turned),
        *(Primitive("revolve", (angle,), outline=outlines[1], **turned) for angle in (90.0, 360.0)),
    ]
    parts = [replace(p, **turned) for p in PARTS.values() if isinstance(p, Primitive)] + drawn
    parts += [cut(parts[0], parts[1]), union(parts[2], parts[-1])]
    points = rng.uniform(-9.0, 9.0, (20_000, 3))
    points = points[np.lexsort(np.floor(points.T / 3))]  # cube after cube
    for part, held in zip(parts, kernels.inside_each(parts, points), strict=True):
        exact = kernels.program_sdf(part, points) < 0
        assert (held == exact).all()
        assert (kernels.inside(part, points) == exact).all()
        assert held.any()


def test_what_is_near_is_in_cells_beside():
    rng = np.random.default_rng(0)
    points, reach = rng.normal(0.0, 1.0, (400, 3)) * [1.0, 3.0, 0.01], 0.4
    grid = PointGrid.of(points, reach)
    at = np.floor((points - grid.low) / grid.cell).astype(int)
    assert (at >= 1).all()
    assert (at < grid.shape - 1).all()
    near = np.linalg.norm(points[:, None] - points, axis=2) < reach
    assert (np.abs(at[:, None] - at).max(2)[near] <= 1).all()
    cell = np.ravel_multi_index(tuple(at.T), tuple(grid.shape))
    assert all((cell[grid.order[grid.first[c] : grid.first[c + 1]]] == c).all() for c in set(cell.tolist()))
    assert [*map(list, find_bounds(points))] == [points.min(0).tolist(), points.max(0).tolist()]
    assert np.prod(PointGrid.of(points, 1e-300).shape) < 1e6
