"""Chains of blends are found again on solids that were made with them, and come off without a trace."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold, OpType
from tests.planted import polar_ball

from imdim.detection.blends import find_chains
from imdim.detection.sharpen import sharpen
from imdim.geometry.edge_solids import solid_with_edges, with_edges
from imdim.geometry.solid import mesh_to_manifold, to_manifold, to_trimesh
from imdim.program.edges import EdgeFeature, Face
from imdim.program.outline import Outline
from imdim.program.tree import Combine, Primitive, Program

QUARTER = math.tan(math.pi / 8)
BOX = Primitive("box", (30.0, 20.0, 8.0))
PLATE = Primitive(
    "extrude",
    (5.0,),
    outline=Outline(
        (
            (
                (-16, -10, 0),
                (16, -10, QUARTER),
                (20, -6, 0),
                (20, 6, QUARTER),
                (16, 10, 0),
                (-16, 10, QUARTER),
                (-20, 6, 0),
                (-20, -6, QUARTER),
            ),
        )
    ),
)


def rim(kind: str, sizes: tuple[float, ...], curves: int | None = None) -> EdgeFeature:
    sides = [f"wall[0][{k}]" for k in range(curves)] if curves else ["+x", "-x", "+y", "-y"]
    return EdgeFeature(kind, sizes, tuple((Face(0, "+z"), Face(0, side)) for side in sides))  # type: ignore[arg-type]


def meshed(program: Program, *features: EdgeFeature) -> trimesh.Trimesh:
    return to_trimesh(solid_with_edges(program, features, 64))


@pytest.mark.parametrize(
    ("program", "feature", "pieces"),
    [
        (BOX, rim("chamfer", (0.5,)), 4),
        (BOX, rim("fillet", (1.5,)), 4),
        (BOX, rim("chamfer", (0.5, 1.0)), 4),
        (PLATE, rim("chamfer", (0.6,), 8), 8),
        (PLATE, rim("fillet", (1.0,), 8), 8),
    ],
    ids=["box chamfer", "box fillet", "two distances", "plate chamfer", "plate fillet"],
)
def test_a_rim_is_found_and_comes_off(program: Program, feature: EdgeFeature, pieces: int) -> None:
    mesh = meshed(program, feature)
    (chain,) = find_chains(mesh)
    assert chain.kind == feature.kind
    assert chain.outside == 1
    assert len(chain.blends) == pieces
    assert sorted(chain.sizes) == pytest.approx(sorted((feature.sizes * 2)[: len(chain.sizes)]), rel=5e-3)
    sharp = sharpen(mesh, [chain])
    assert not sharp.kept
    assert find_chains(sharp.mesh) == []
    wanted = to_manifold(program, 64)
    both = (mesh_to_manifold(sharp.mesh) ^ wanted).volume()
    assert both == pytest.approx(wanted.volume(), rel=2e-4)
    assert sharp.mesh.volume == pytest.approx(wanted.volume(), rel=2e-4)


def test_a_concave_rim_is_taken_off_by_taking_away() -> None:
    plate = Primitive("box", (40.0, 30.0, 4.0))
    block = Primitive("box", (16.0, 10.0, 12.0), (0.0, 0.0, 6.0))
    foot = EdgeFeature("fillet", (2.0,), tuple((Face(0, "+z"), Face(1, side)) for side in ("+x", "-x", "+y", "-y")))
    mesh = meshed(Combine("union", plate, block), foot)
    (chain,) = find_chains(mesh)
    assert (chain.kind, chain.outside) == ("fillet", -1)
    assert chain.sizes[0] == pytest.approx(2.0, rel=5e-3)


def test_a_ball_has_none() -> None:
    assert find_chains(meshed(Primitive("sphere", (5.0,)))) == []


def test_corners_of_one_outline_are_no_edge_features() -> None:
    assert find_chains(meshed(PLATE)) == []
    slot = Combine("difference", BOX, Primitive("cylinder", (3.0, 20.0)))
    assert find_chains(meshed(slot)) == []


def test_a_turned_parts_fillets_are_its_profiles() -> None:
    shaft = Primitive("cylinder", (5.0, 20.0))
    ends = EdgeFeature("fillet", (1.0,), ((Face(0, "+z"), Face(0, "side")), (Face(0, "-z"), Face(0, "side"))))
    assert find_chains(meshed(shaft, ends)) == []


def test_narrow_chamfers_of_round_rims_are_edge_features() -> None:
    def drilled(size: float) -> trimesh.Trimesh:
        out = Combine("difference", BOX, Primitive("cylinder", (3.0, 20.0)))
        for up in (1.0, -1.0):
            wide, narrow = (3.0 + size, 3.0) if up > 0 else (3.0, 3.0 + size)
            out = Combine("difference", out, Primitive("cone", (narrow, wide, size), (0.0, 0.0, up * (4.0 - size / 2))))
        return meshed(out)

    found = find_chains(drilled(0.6))
    assert [(chain.is_rim, chain.outside) for chain in found] == [(True, 1), (True, 1)]
    assert np.ravel([chain.sizes for chain in found]) == pytest.approx(4 * [0.6], rel=5e-3)
    assert len(find_chains(drilled(1.4))) == 2  # as far as the holes' own rule goes
    assert find_chains(drilled(1.6)) == []  # countersinks
    off = sharpen(drilled(0.6), found)
    assert off is not None
    sharp = to_manifold(Combine("difference", BOX, Primitive("cylinder", (3.0, 20.0))), 64).volume()
    assert off.mesh.volume == pytest.approx(sharp, rel=1e-6)


PIN_ENDS = tuple((Face(0, "side"), Face(0, end)) for end in ("+z", "-z"))


@pytest.mark.parametrize("distance", [1.0, 2.0, 3.0])
def test_the_even_chamfer_of_a_pins_end_is_an_edge_feature_however_little_it_leaves(distance: float) -> None:
    pin = Primitive("cylinder", (7.0, 14.0))
    chains = find_chains(meshed(pin, EdgeFeature("chamfer", (distance,), PIN_ENDS)))
    assert [len(chain.blends) for chain in chains] == [1, 1]
    assert all(chain.sizes == pytest.approx((distance, distance), rel=5e-3) for chain in chains)


@pytest.mark.parametrize("sizes", [(4.0,), (1.0, 3.0)])
def test_a_pins_point_is_none(sizes: tuple[float, ...]) -> None:
    assert find_chains(meshed(Primitive("cylinder", (7.0, 14.0)), EdgeFeature("chamfer", sizes, PIN_ENDS))) == []


def test_the_cone_at_a_bosss_foot_and_in_its_mouth_are_shapes_of_their_own() -> None:
    """As wide and as steep as these nobody draws chamfers."""
    foot = 12.0
    plate, boss = Primitive("box", (80.0, 60.0, 8.0)), Primitive("cylinder", (18.0, 36.0), (0.0, 0.0, 14.0))
    skirt = Primitive("cone", (24.0, 18.0, foot), (0.0, 0.0, 4.0 + foot / 2))
    bore, mouth = Primitive("cylinder", (10.0, 60.0)), Primitive("cone", (10.0, 14.0, 8.0), (0.0, 0.0, 29.0))
    part = Combine("difference", Combine("difference", Combine("union", Combine("union", plate, boss), skirt), bore), mouth)
    assert find_chains(to_trimesh(to_manifold(part, 96))) == []


@pytest.mark.parametrize("flats", [10.7, 9.0])
def test_a_chamfer_that_flats_have_cut_comes_off(flats: float) -> None:
    """Its border on a flat ends on that, and not where the round wall would have been."""
    pin, sides = Primitive("cylinder", (6.7, 13.4)), Primitive("box", (30.0, flats, 30.0))
    sharp = Combine("difference", Combine("intersection", pin, sides), Primitive("cylinder", (4.4, 20.0)))
    whole = with_edges(sharp, [EdgeFeature("chamfer", (1.4,), PIN_ENDS)])
    mesh = to_trimesh(to_manifold(whole, 96))
    chains = find_chains(mesh)
    assert [chain.sizes for chain in chains] == [pytest.approx((1.4, 1.4), rel=5e-3)] * 4
    found = sharpen(mesh, chains)
    assert len(found.chains) == 4
    solid, wanted = mesh_to_manifold(found.mesh), to_manifold(sharp, 96)
    assert ((solid - wanted) + (wanted - solid)).volume() < 2e-3 * wanted.volume()


def test_the_chamfer_once_around_a_slot_is_an_edge_feature_however_low_its_wall_is() -> None:
    slot = Primitive("extrude", (4.0,), outline=Outline((((-4, -2.2, 0), (4, -2.2, 1), (4, 2.2, 0), (-4, 2.2, 1)),)))
    part = Combine("difference", Primitive("box", (30.0, 20.0, 2.4)), slot)
    mouth = EdgeFeature("chamfer", (0.9,), tuple((Face(0, "+z"), Face(1, f"wall[0][{k}]")) for k in range(4)))
    (chain,) = find_chains(meshed(part, mouth))
    assert (chain.kind, chain.outside, len(chain.blends)) == ("chamfer", 1, 4)
    assert chain.sizes == pytest.approx((0.9, 0.9), rel=5e-3)
    opened = replace(mouth, edges=mouth.edges[:3])  # the cone at one end tells what the flats beside it are
    (chain,) = find_chains(meshed(part, opened))
    assert len(chain.blends) == 3
    straight = replace(mouth, edges=mouth.edges[:1])  # as wide as the wall beside it, it may as well be a wall itself
    assert find_chains(meshed(part, straight)) == []


def test_what_bounds_no_solid_then_stays() -> None:
    mesh = meshed(BOX, rim("chamfer", (0.5,)))
    (chain,) = find_chains(mesh)
    opened = trimesh.Trimesh(mesh.vertices, np.asarray(mesh.faces)[:-1], process=False)
    blends = [b for b in chain.blends if b.triangles.max() < len(opened.faces)]
    assert sharpen(opened, [type(chain)(tuple(blends))]).chains == []


@pytest.mark.parametrize("facets", [32, 48])
def test_a_box_rounded_by_rods_and_coarse_balls_comes_off(facets: int) -> None:
    """What OpenSCAD's rounded boxes are: facets of rods meet flat walls at half a step, and slivers lie between rods and balls."""
    sides, r = np.array([60.0, 40.0, 25.0]), 6.0
    parts, inner = [], sides / 2 - r
    for axis in range(3):
        other = [k for k in range(3) if k != axis]
        parts.append(Manifold.cube([sides[k] - (0 if k == axis else 2 * r) for k in range(3)], True))
        rod = Manifold.cylinder(2 * inner[axis], r, r, facets, True)
        rod = rod.rotate([(0, 90, 0), (-90, 0, 0), (0, 0, 0)][axis])
        for one, two in itertools.product((-1, 1), repeat=2):
            shift = np.zeros(3)
            shift[other] = one * inner[other[0]], two * inner[other[1]]
            parts.append(rod.translate(shift.tolist()))
    ball = polar_ball(r, facets)
    parts += [ball.translate((np.array(signs) * inner).tolist()) for signs in itertools.product((-1, 1), repeat=3)]
    mesh = to_trimesh(Manifold.batch_boolean(parts, OpType.Add))
    chains = find_chains(mesh)
    assert [(chain.kind, round(chain.sizes[0], 1)) for chain in chains] == [("fillet", r)]
    sharp = sharpen(mesh, chains)
    assert not sharp.kept
    assert mesh_to_manifold(sharp.mesh).volume() == pytest.approx(sides.prod(), rel=2e-3)


def test_slivers_across_a_fillet_do_not_part_it() -> None:
    """Without `without_slivers` booleans leave strips of no width that face any way."""
    every = tuple((Face(0, x), Face(0, y)) for x in ("+x", "-x") for y in ("+y", "-y"))
    feature = EdgeFeature("fillet", (3.0,), (*rim("fillet", (3.0,)).edges, *every))
    block = Primitive("box", (40.0, 30.0, 20.0))
    mesh = to_trimesh(to_manifold(with_edges(block, [feature]), 96))
    (chain,) = find_chains(mesh)
    assert len(chain.blends) == 12  # eight edges, four corners
    assert mesh_to_manifold(sharpen(mesh, [chain]).mesh).volume() == pytest.approx(24000, rel=1e-3)
