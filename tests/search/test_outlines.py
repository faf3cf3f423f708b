"""Outlines as candidate families: plane arrangements, the best region, and planted parts that come back as one outline."""

import math
from contextlib import suppress
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from imdim.geometry.kernels import inside
from imdim.geometry.solid import to_manifold, to_trimesh, volume_iou
from imdim.geometry.surface import Surface
from imdim.program.cost import CURVE_PRICES, curves_of
from imdim.program.outline import Outline, check_crossings, circle
from imdim.program.tree import Combine, Primitive, leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.observation import UnitBody, observe
from imdim.reconstruction.pipeline import reconstruct
from imdim.search.arrangement import ArrangementConfig, arrange
from imdim.search.outline_drawing import trace_loops
from imdim.search.outline_families import MOST_WALLS, find_planes
from imdim.search.outline_kernels import offer_outlines
from imdim.search.outline_plane import OUTSIDE, Walls, _unpack, make_plane
from imdim.search.outline_region import best_region, count_curves
from imdim.target.target import in_unit_frame, target_from

CORNER = np.tan(np.pi / 8)  # the bulge of a quarter turn


def plane(rng, lines, circles):
    """The arrangement of random walls in the unit square."""
    turn = rng.uniform(0, np.pi, lines)
    normals = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    offsets = (rng.uniform(0.2, 0.8, (lines, 2)) * normals).sum(1)
    columns = tuple((0, i) for i in range(lines + circles))
    walls = Walls(
        normals, offsets, rng.uniform(0.2, 0.8, (circles, 2)), rng.uniform(0.05, 0.4, circles), np.array([[0.0, 0], [1, 1]]), columns
    )
    return make_plane("extrude", 0, np.zeros(3), np.eye(3), walls)


@pytest.mark.parametrize("seed", range(12))
def test_the_faces_fill_the_window_and_every_boundary_closes(seed):
    rng = np.random.default_rng(seed)
    found = plane(rng, int(rng.integers(2, 7)), int(rng.integers(0, 5)))
    every = np.ones(found.faces, bool)
    outline = Outline(trace_loops(found, every))
    assert outline.area == pytest.approx(1.0, abs=1e-9)
    assert count_curves(found, every) == 4
    areas = []
    for face in range(found.faces):
        alone = np.arange(found.faces) == face
        loops = trace_loops(found, alone)
        areas.append(Outline(loops).area)
        assert sum(len(loop) for loop in loops) >= count_curves(found, alone)
    assert sum(areas) == pytest.approx(1.0, abs=1e-4), "crossings that are one node leave out slivers"


@pytest.mark.parametrize("seed", range(8))
def test_a_face_lies_where_its_walls_say(seed):
    rng = np.random.default_rng(seed)
    found = plane(rng, 5, 3)
    points = rng.random((400, 2))
    sides = found.walls.sides(points)
    clear = (np.abs(points @ found.walls.normals.T - found.walls.offsets) > 2e-3).all(1)
    clear &= (np.abs(np.linalg.norm(points[:, None] - found.walls.centers, axis=2) - found.walls.radii) > 2e-3).all(1)
    own = _unpack(found.codes, sides.shape[1])
    for point, code in zip(points[clear], sides[clear], strict=True):
        faces = np.flatnonzero((own == code).all(1))
        held = [f for f in faces if _is_in(Outline(trace_loops(found, np.arange(found.faces) == f)), point)]
        assert len(held) == 1


def _is_in(outline, point):
    from imdim.program.outline import is_in_loop

    return sum(is_in_loop(loop, *point) for loop in outline.loops) % 2 == 1


def test_the_best_region_is_nearly_as_good_as_the_best_of_all():
    """Repeated cuts are no exact minimum of a cooperative cut: they reach it in most cases."""
    shares = [_share_of_best(seed, 0.05) for seed in range(24)]
    assert np.mean(shares) > 0.95
    assert np.mean([share > 1 - 1e-9 for share in shares]) > 0.7


def _share_of_best(seed, price):
    """What the region that is found wins, of what the best of all regions of a small plane wins."""
    rng = np.random.default_rng(seed)
    found = plane(rng, 3, 1)
    assert found.faces <= 14
    gains = rng.normal(0, 1, found.faces)

    def value(inside):
        return gains[inside].sum() - price * count_curves(found, inside)

    region = best_region(found, gains, price)
    assert region.gain == pytest.approx(gains[region.inside].sum())
    assert region.curves == count_curves(found, region.inside)
    check_crossings(Outline(trace_loops(found, region.inside)))
    return value(region.inside) / max(value(np.array(bits, bool)) for bits in product((False, True), repeat=found.faces))


@pytest.mark.parametrize("seed", range(8))
def test_outlines_on_offer_are_the_best_regions_between_levels(seed):
    rng, levels, price, paid = np.random.default_rng(seed), 4, 0.05, (4, 0.5)
    found = plane(rng, 3, 1)
    sums = rng.normal(0, 1, (found.faces + 1) * levels)
    slabs = -sums[: found.faces * levels].reshape(-1, levels)
    most, count, lo, hi, wins, faces = offer_outlines(found.graph, sums, found.faces, levels, -1.0, 0.0, price, paid)

    def value(region, gains):
        return gains[region].sum() - price * max(count_curves(found, region) - paid[0], paid[1])

    # a slot is of what lies right below its level
    gains = slabs[:, lo + 1 : hi + 1].sum(1)
    assert wins[0] >= wins[count - 1] > 0
    for won, region in zip(wins[:count], faces, strict=False):
        assert won == pytest.approx(value(region, gains))
    region = best_region(found, gains, price)
    assert wins[0] == pytest.approx(value(region.inside, gains)) or wins[0] > value(region.inside, gains)
    assert wins[0] <= most
    assert offer_outlines(found.graph, sums, found.faces, levels, -1.0, most, price, paid)[1] == 0


@pytest.mark.parametrize("off", [0.0, 1e-6, 3e-5, 6e-4, -6e-4])
def test_a_circle_that_a_line_all_but_touches_is_whole(off):
    """The wide hole of a fan holder is as wide as the frame beside it, but for half a thousandth: it was left out."""
    walls = Walls(
        np.array([[1.0, 0.0]]),
        np.array([0.25 - off]),
        np.zeros((1, 2)),
        np.array([0.25]),
        np.array([[-0.5, -0.5], [0.5, 0.5]]),
        ((0, 0), (0, 1)),
    )
    found = make_plane("extrude", 0, np.zeros(3), np.eye(3), walls)
    areas = []
    for face in range(found.faces):
        with suppress(ValueError):  # what is around it touches itself where they touch
            areas.append(Outline(trace_loops(found, np.arange(found.faces) == face)).area)
    assert min(abs(area - np.pi * 0.25**2) for area in areas) < 4e-4


def test_what_wins_nothing_has_no_region():
    found = plane(np.random.default_rng(0), 4, 1)
    assert best_region(found, -np.ones(found.faces), 0.1) is None
    assert best_region(found, np.full(found.faces, 1e-3), 1.0) is None


def test_a_wall_within_the_window_has_a_face_on_either_side():
    found = plane(np.random.default_rng(0), 3, 0)
    assert OUTSIDE not in found.segments.faces[found.segments.wall >= 0]


def rounded(width, height, radius):
    """A loop of a rectangle with round corners about the origin."""
    x, y, r = width / 2, height / 2, radius
    corners = [(-x, -y + r), (-x + r, -y), (x - r, -y), (x, -y + r), (x, y - r), (x - r, y), (-x + r, y), (-x, y - r)]
    return tuple((a, b, CORNER if i % 2 == 0 else 0.0) for i, (a, b) in enumerate(corners))


SLOT = ((-8.0, -3.0, 0.0), (8.0, -3.0, 1.0), (8.0, 3.0, 0.0), (-8.0, 3.0, 1.0))
PLATE = Primitive("extrude", (6.0,), (3.0, -2.0, 5.0), (0.0, 0.0, 0.0), Outline((rounded(60, 40, 8), SLOT, circle(3.0, 20.0, 12.0))))
ANGLE = Primitive(
    "extrude", (30.0,), (0.0, 0.0, 0.0), (90.0, 0.0, 0.0), Outline((((-20.0, -20.0, 0.0), (20.0, -20.0, 0.0), (20.0, -14.0, 0.0),
                                                                    (-14.0, -14.0, 0.0), (-14.0, 20.0, 0.0), (-20.0, 20.0, 0.0)),))
)  # fmt: skip
KNOB = Primitive(
    "revolve", (360.0,), (1.0, 2.0, 3.0), (30.0, 0.0, 0.0), Outline((((0.0, -10.0, 0.0), (12.0, -10.0, 0.0), (12.0, -4.0, 0.0),
                                                                     (8.0, 2.0, 0.0), (8.0, 10.0, 0.0), (0.0, 10.0, 0.0)),))
)  # fmt: skip


def reconstructed(program, **settings):
    """What is found of a program's mesh, by a clock that stands still."""
    target = target_from(to_trimesh(to_manifold(program, 64)))
    *_, last = reconstruct(target, Settings(**settings), np.random.default_rng(0), lambda: 0.0)
    return last.program


@pytest.mark.parametrize(("planted", "curves"), [(PLATE, 13), (ANGLE, 6), (KNOB, 6)])
def test_a_planted_outline_comes_back_as_one_feature(planted, curves):
    found = reconstructed(planted, objective="primitives")
    (leaf,) = leaves(found)
    assert leaf.kind == planted.kind
    assert curves_of(leaf) == curves
    assert volume_iou(to_manifold(found, 64), to_manifold(planted, 64)) > 0.999


def test_an_outline_is_cut_by_an_outline():
    pocket = Primitive("extrude", (4.0,), (3.0, -2.0, 7.0), (0.0, 0.0, 0.0), Outline((rounded(30, 20, 4),)))
    plate = Primitive("extrude", (6.0,), (3.0, -2.0, 5.0), (0.0, 0.0, 0.0), Outline((rounded(60, 40, 8),)))
    found = reconstructed(Combine("difference", plate, pocket), objective="primitives")
    assert len(list(leaves(found))) == 2
    assert volume_iou(to_manifold(found, 64), to_manifold(Combine("difference", plate, pocket), 64)) > 0.999


def test_boxes_and_cylinders_stay_what_they_are_and_csg_draws_nothing():
    bored = Combine("difference", Primitive("box", (40.0, 30.0, 10.0)), Primitive("cylinder", (6.0, 10.0)))
    assert all(leaf.outline is None for leaf in leaves(reconstructed(PLATE, language="csg")))
    assert sorted(leaf.kind for leaf in leaves(reconstructed(Primitive("box", (40.0, 30.0, 10.0))))) == ["box"]
    assert len(list(leaves(reconstructed(bored)))) <= 2


def test_chamfers_that_are_not_worth_their_curves_are_drawn_where_primitives_alone_are_counted():
    c = 0.2  # each corner is 8e-6 of the area, and a curve costs 2.5e-5
    corners = [(-30 + c, -20), (30 - c, -20), (30, -20 + c), (30, 20 - c), (30 - c, 20), (-30 + c, 20), (-30, 20 - c), (-30, -20 + c)]
    chamfered = Primitive("extrude", (6.0,), outline=Outline((tuple((x, y, 0.0) for x, y in corners),)))
    plain, drawn = (next(leaves(reconstructed(chamfered, objective=what))) for what in CURVE_PRICES)
    assert curves_of(plain) < curves_of(drawn) == 8


def test_what_is_cut_away_ends_beyond_the_part():
    """A corner cut out flush with two faces of the part would leave skins of no thickness there."""
    plate = Primitive("box", (60.0, 40.0, 20.0), (0.0, 0.0, -7.0))
    corner = Primitive("extrude", (3.0,), (20.0, 12.0, 2.0), (0.0, 0.0, 0.0), Outline((rounded(30, 24, 6),)))
    unit, frame = in_unit_frame(target_from(to_trimesh(to_manifold(Combine("difference", plate, corner), 64))))
    rng = np.random.default_rng(0)
    seen = observe(UnitBody.of(unit, rng), 2.5e-4, rng, outlines=True)
    cells, outlines = seen.cells, seen.families.outlines
    filled = inside(frame.apply(plate), cells.points)
    upright = next(i for i, p in enumerate(outlines.planes) if p.kind == "extrude" and abs(p.frame[2, 2]) > 0.99)
    sums = outlines.slots[upright].sum_values(np.arange(len(filled)), np.where(filled, -cells.gain, 0.0))
    drawn = outlines.best(upright, sums, 0.0)
    assert drawn is not None
    _, ranges, faces = drawn
    wider = outlines.widen(upright, ranges, faces, filled)
    assert (outlines.mask(upright, ranges, wider)[filled] == outlines.mask(upright, ranges, faces)[filled]).all()
    low, high = np.reshape(to_manifold(frame.undo(outlines.primitive(upright, ranges, wider))).bounding_box(), (2, 3))
    assert low[[0, 2]] == pytest.approx([5, 0.5], abs=1e-6)
    assert (high > [30.1, 20.1, 3.1]).all()


def test_walls_without_length_are_no_error():
    """Where walls all but meet in a point some of their segments have none."""
    found = plane(np.random.default_rng(3), 4, 1)
    flat = replace(found, segments=replace(found.segments, length=np.zeros_like(found.segments.length)))
    region = best_region(flat, np.random.default_rng(0).normal(0, 1, found.faces), 0.05)
    assert region is not None
    assert region.inside.any()


def test_a_plane_of_too_many_walls_keeps_those_that_show_the_most():
    """Of a hundred walls the ten of least area are left out; the others still cut the plane."""
    level = [Surface("plane", (0.0, 0.0, z), (0.0, 0.0, 1.0)) for z in (-1.0, 1.0)]
    turns = np.linspace(0.1, 3.1, MOST_WALLS + 10).tolist()
    walls = [Surface("plane", (math.cos(a), math.sin(a), 0.0), (math.cos(a), math.sin(a), 0.0)) for a in turns]  # about a circle
    areas = [50.0, 50.0, *np.linspace(1.0, 3.0, len(walls)).tolist()]
    bounds = np.array([[-2.0, -2.0, -1.0], [2.0, 2.0, 1.0]])
    limits = ArrangementConfig(max_directions=len(walls) + 2, least_wall=1e-6, least_direction=1e-6)
    arrangement = arrange([*level, *walls], areas, bounds, limits)
    (plane,) = (p for p in find_planes(arrangement) if np.abs(arrangement.directions[p.direction].vector[2]) > 0.9)
    shown = [arrangement.directions[b].shown[k] for b, k in plane.walls.columns]
    assert len(shown) == MOST_WALLS
    assert min(shown) > sorted(areas)[len(walls) - MOST_WALLS - 1]
