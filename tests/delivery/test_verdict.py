import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from tests.planted import box, cut, cylinder, mesh_of, union
from tests.threaded import bolt

from imdim.delivery import surface_elements
from imdim.delivery.verdict import SurfaceVerdict, judge, percent
from imdim.geometry.metrics import diagonal
from imdim.program.outline import Outline
from imdim.program.tree import Combine, Primitive, Program
from imdim.target.target import Target, target_from

PLATE = box(60, 40, 6)
BOSS = cylinder(9, 14, (0, 0, 10))
HOLES = [cylinder(3, 20, (x, 0, 0)) for x in (-22, 22)]


def polygon(*corners: tuple[float, float]) -> tuple[tuple[float, float, float], ...]:
    return tuple((x, y, 0.0) for x, y in corners)


def drawn(height: float, *loops, center=(0.0, 0.0, 0.0)) -> Primitive:
    return Primitive("extrude", (height,), center, outline=Outline(loops))


def gear(teeth: int) -> Primitive:
    places = ((0.0, 19.0), (0.3, 19.0), (0.5, 21.0), (0.8, 21.0))
    turns = [(2 * math.pi * (i + share) / teeth, r) for i in range(teeth) for share, r in places]
    return drawn(8.0, polygon(*((r * math.cos(a), r * math.sin(a)) for a, r in turns)))


def rack(teeth: int) -> Primitive:
    tips = [(2.0 * i + x, y) for i in range(teeth) for x, y in ((0.2, 5.0), (0.6, 6.5), (1.1, 6.5), (1.5, 5.0))]
    return drawn(8.0, polygon((0, 0), (2 * teeth, 0), (2 * teeth, 5), *reversed(tips), (0, 5)))


LETTERS = (
    polygon((-20, -5), (-14, -5), (-14, -3.5), (-18.5, -3.5), (-18.5, 5), (-20, 5)),  # L
    polygon((-10, -5), (-8.5, -5), (-8.5, 5), (-10, 5)),  # I
    polygon((-3, -5), (-1.5, -5), (-1.5, 3.5), (1, 3.5), (1, 5), (-5.5, 5), (-5.5, 3.5), (-3, 3.5)),  # T
    polygon((6, -5), (12, -5), (12, 5), (6, 5)),  # O, with the next one
    polygon((7.5, -3.5), (10.5, -3.5), (10.5, 3.5), (7.5, 3.5)),
)


def verdict_on(target: Program | np.ndarray | trimesh.Trimesh, result: Program) -> SurfaceVerdict:
    return judge(target_of(target), mesh_of(result))


def target_of(target: Program | np.ndarray | trimesh.Trimesh) -> Target:
    return target_from(target if isinstance(target, np.ndarray | trimesh.Trimesh) else mesh_of(target))


def test_what_is_missed_is_left_out_with_its_share():
    """By areas that are known: the walls of the holes, and the boss without the disc on which it stands."""
    part = cut(union(PLATE, BOSS), *HOLES)
    walls, round_wall = 2 * math.pi * 3 * 6, 2 * math.pi * 9 * 14
    whole = 2 * (60 * 40 + 60 * 6 + 40 * 6) - 4 * math.pi * 9 + 2 * walls + round_wall
    found = verdict_on(part, PLATE)
    assert found.shares["exact"] == pytest.approx(1 - (2 * walls + round_wall + math.pi * 81) / whole, abs=2e-3)
    assert found.shares["approximated"] == 0
    boss, *holes = found.regions
    assert (boss.verdict, boss.what, boss.where) == ("left out", "18 x 18 x 14", "at (0, 0, 10)")
    assert boss.share == pytest.approx((round_wall + math.pi * 81) / whole, rel=0.01)
    assert sorted(hole.where for hole in holes) == ["at (-22, 0, 0)", "at (22, 0, 0)"]
    assert {hole.verdict for hole in holes} == {"left out"}
    same = verdict_on(part, part)
    assert same.overall == "exact"
    assert same.shares["exact"] == 1
    assert not same.regions


def test_what_runs_beside_it_is_approximated():
    """A plate half a millimetre too thin, and a ramp that is a step."""
    found = verdict_on(PLATE, box(60, 40, 5))
    assert found.overall == "approximated"
    assert [region.verdict for region in found.regions if region.share > 0.1] == ["approximated"] * 2
    assert {region.where[-7:] for region in found.regions if region.share > 0.1} == {"+z side", "-z side"}


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_the_scale_does_not_matter(scale):
    mesh, result = mesh_of(cut(PLATE, *HOLES)), mesh_of(PLATE)
    found = judge(target_from(trimesh.Trimesh(mesh.vertices * scale, mesh.faces)), trimesh.Trimesh(result.vertices * scale, result.faces))
    assert [region.verdict for region in found.regions] == ["left out"] * 2
    assert found.regions[0].furthest == pytest.approx(3 * scale, rel=0.01)  # half of the plate, where the walls are halved


@pytest.mark.parametrize("sides", [8, 16, 200])
def test_facets_of_a_round_wall_are_exact(sides):
    """Chords lie off their circle by up to a twelfth of the radius."""
    target = target_from(trimesh.creation.cylinder(10, 30, sections=sides))
    assert judge(target, mesh_of(cylinder(10, 30))).shares["exact"] == 1
    smaller = judge(target, mesh_of(cylinder(8, 30))).shares["exact"]  # of whose caps the inner part alone is right
    assert smaller == pytest.approx(0.16, abs=0.03)


def test_flats_that_lean_to_each_other_are_no_curve():
    """A wall that leans between two upright ones is a tenth of a millimetre off, by less than chords that turn so would be."""
    leaning = polygon((0, 0), (20, 0), (20, 10), (19, 20), (19, 30), (0, 30))
    lower = polygon((0, 0), (20, 0), (20, 9), (19, 19), (19, 30), (0, 30))
    found = verdict_on(drawn(20.0, leaning), drawn(20.0, lower))
    assert found.shares["approximated"] == pytest.approx(20 * 10 / (2 * 585 + 20 * 100), abs=0.02)
    assert found.tolerance < 0.02


@pytest.mark.parametrize("normals", [False, True])
def test_the_tolerance_of_a_cloud_is_its_noise(normals):
    mesh, rng = mesh_of(cut(union(PLATE, BOSS), *HOLES)), np.random.default_rng(2)
    points, faces = trimesh.sample.sample_surface(mesh, 8192, seed=1)[:2]
    points = points + rng.normal(scale=0.2, size=points.shape)
    cloud = np.column_stack([points, mesh.face_normals[faces]]) if normals else points
    assert judge(target_from(cloud), mesh).shares["exact"] > 0.998
    found = verdict_on(cloud, PLATE)
    assert found.shares["left out"] == pytest.approx(verdict_on(mesh, PLATE).shares["left out"], abs=0.03)
    assert 0.4 < found.tolerance < 1.0


def test_a_stray_point_shows_no_region():
    mesh = mesh_of(PLATE)
    points = np.concatenate([trimesh.sample.sample_surface(mesh, 8192, seed=1)[0], [(0.0, 0.0, 15.0)]])
    assert judge(target_from(points), mesh).shares["exact"] == 1


@pytest.mark.parametrize("teeth", [12, 60])
def test_teeth_are_one_thing(teeth):
    found = verdict_on(gear(teeth), cylinder(20, 8))
    (region,) = [region for region in found.regions if region.kind == "teeth"]
    assert region.what.startswith(f"{teeth} teeth on a circle of ")
    assert region.verdict == "left out"
    assert region.share > 0.9 * found.shares["left out"]


def wave(teeth: int, steps: int = 12) -> Primitive:
    turns = [2 * math.pi * i / (teeth * steps) for i in range(teeth * steps)]
    reach = [20 + 0.8 * math.sin(teeth * a) for a in turns]
    return drawn(8.0, polygon(*((r * math.cos(a), r * math.sin(a)) for a, r in zip(turns, reach, strict=True))))


def blocks(teeth: int) -> Program:
    """Of parallel flanks, and roots that lie on the chords of a cylinder."""
    turns = [2 * math.pi * i / teeth for i in range(teeth)]
    return union(cylinder(20, 8), *(box(2, 1.2, 8, (20.5 * math.cos(a), 20.5 * math.sin(a), 0), (0, 0, math.degrees(a))) for a in turns))


@pytest.mark.parametrize(
    ("part", "result", "teeth"),
    [
        (wave(40), cylinder(20, 8), [40]),
        (blocks(36), cylinder(20, 8), [36]),
        (cut(cylinder(30, 8), replace(gear(30), size=(20.0,))), cut(cylinder(30, 8), cylinder(20, 20)), [30]),
        (union(gear(30), replace(gear(24), center=(60.0, 0.0, 0.0))), union(cylinder(20, 8), cylinder(20, 8, (60, 0, 0))), [30, 24]),
    ],
    ids=["round", "parallel flanks", "inside a ring", "two gears"],
)
def test_teeth_of_other_forms(part, result, teeth):
    found = verdict_on(part, result)
    regions = [region for region in found.regions if region.kind == "teeth"]
    assert [int(region.what.split()[0]) for region in regions] == teeth
    assert sum(region.share for region in regions) > 0.95 * found.shares["left out"]


def test_slots_of_a_grating_are_no_teeth():
    found = verdict_on(cut(PLATE, *(box(1, 30, 20, (x, 0, 0)) for x in range(-24, 25, 2))), PLATE)
    assert len(found.regions) == 25
    assert {region.kind for region in found.regions} == {""}


@pytest.mark.parametrize("place", [np.eye(4), trimesh.transformations.rotation_matrix(0.7, [1, 2, 3], [9, 0, 0])], ids=["plain", "aslant"])
def test_a_thread_is_one_thing(place):
    head, rod = mesh_of(cylinder(6.5, 5, (0, 0, -2.5))), mesh_of(cylinder(4, 16, (0, 0, 8)))
    plain = trimesh.boolean.union([head, rod]).apply_transform(place)
    found = judge(target_from(bolt().apply_transform(place)), plain)
    (region,) = [region for region in found.regions if region.kind == "thread"]
    assert region.what.startswith("thread M8 x 1.25, pitch 1.25, diameters 6.4")
    assert region.share > 0.95 * (found.shares["left out"] + found.shares["approximated"])


def test_a_thread_that_the_result_has_is_not_told():
    assert not judge(target_from(bolt()), bolt()).regions


def test_teeth_in_a_row():
    found = verdict_on(rack(15), box(30, 5, 8, (15, 2.5, 0)))
    (region,) = [region for region in found.regions if region.kind == "teeth"]
    assert region.what.startswith("15 teeth in a row")
    assert region.verdict == "left out"


def test_teeth_that_the_program_has_are_not_told():
    assert not verdict_on(gear(40), gear(40)).regions
    with_hole = cut(gear(40), cylinder(5, 20))
    assert [region.kind for region in verdict_on(with_hole, gear(40)).regions] == [""]


@pytest.mark.parametrize(
    "lost",
    [
        [cylinder(2, 20, (22 * math.cos(a), 14 * math.sin(a), 0)) for a in np.arange(12) * math.pi / 6],
        [cylinder(1.5, 20, (14 * math.cos(a), 14 * math.sin(a), 0)) for a in np.arange(12) * math.pi / 6],
        [cylinder(2, 3, (x, y, 3)) for x in (-20, -10, 0, 10, 20) for y in (-12, 0, 12)],
    ],
)
def test_holes_and_pockets_are_neither_teeth_nor_text(lost):
    found = verdict_on(cut(PLATE, *lost), PLATE)
    assert len(found.regions) == len(lost)
    assert {(region.verdict, region.kind) for region in found.regions} == {("left out", "")}


@pytest.mark.parametrize(("how", "height"), [("raised", 0.8), ("sunk", 0.8)])
def test_text_is_set_apart_from_the_face_that_carries_it(how, height):
    if how == "raised":
        part = Combine("union", PLATE, drawn(height + 1, *LETTERS, center=(0.0, 0.0, 2.5 + height / 2)))
    else:
        part = Combine("difference", PLATE, drawn(height + 1, *LETTERS, center=(0.0, 0.0, 3.5 - height / 2)))
    (region,) = verdict_on(part, PLATE).regions
    assert region.kind == "text"
    assert region.verdict == "left out"
    assert region.what.startswith(f"text or decoration, 4 pieces {how} by 0.8")
    assert verdict_on(part, PLATE).overall == "approximated"


def wavy(rounds: int) -> trimesh.Trimesh:
    """A block with a top of hills and hollows."""
    heights = np.linspace(-20, 20, rounds)
    x, y = np.meshgrid(heights, heights, indexing="ij")
    top = np.column_stack([x.ravel(), y.ravel(), (8 + 2 * np.sin(x / 8) * np.cos(y / 9)).ravel()])
    index = np.arange(rounds * rounds).reshape(rounds, rounds)
    a, b, c, d = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    upper = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    lower = upper[:, ::-1] + rounds * rounds
    rim = np.concatenate([index[:, 0], index[-1, 1:], index[-2::-1, -1], index[0, -2:0:-1]])
    after = np.roll(rim, -1)
    deep = rounds * rounds
    sides = np.concatenate([np.column_stack([after, rim, rim + deep]), np.column_stack([after, rim + deep, after + deep])])
    return trimesh.Trimesh(np.concatenate([top, top * (1, 1, 0)]), np.concatenate([upper, lower, sides]), process=False)


def test_a_surface_bent_in_two_ways_is_freeform():
    mesh = wavy(41)
    assert mesh.is_watertight
    assert mesh.volume > 0
    found = verdict_on(mesh, box(40, 40, 8, (0, 0, 4)))
    assert found.regions[0].kind == "freeform"
    assert found.regions[0].verdict == "approximated"


def test_a_missing_ball_is_not_freeform():
    part = union(PLATE, Primitive("sphere", (5.0,), (0.0, 0.0, 3.0)))
    (region,) = verdict_on(part, PLATE).regions
    assert (region.verdict, region.kind) == ("left out", "")


def test_nothing_of_a_part_is_in_an_empty_result():
    found = verdict_on(PLATE, cut(PLATE, box(80, 80, 80)))
    assert found.overall == "left out"
    assert found.shares["left out"] == 1


def test_another_part_is_left_out():
    assert verdict_on(PLATE, cylinder(3, 80)).overall == "left out"


@pytest.mark.parametrize(
    ("share", "said"), [(1, "100 %"), (0.99999, "over 99.9 %"), (0.123, "12.3 %"), (1e-5, "under 0.1 %"), (0, "0 %"), (1 - 1e-12, "100 %")]
)
def test_shares_in_words(share, said):
    assert percent(share) == said


def test_the_size_of_the_part_is_measured_once_for_all_regions(monkeypatch):
    """Of a part with hundreds of regions that was a twentieth of a fit."""
    asked = []
    monkeypatch.setattr(surface_elements, "diagonal", lambda points: asked.append(len(points)) or diagonal(points))
    blocks = [trimesh.creation.box((1.0, 1.0, 1.0)).apply_translation((3.0 * k, 0.0, 0.0)) for k in range(6)]
    verdict = judge(target_from(trimesh.util.concatenate(blocks)), blocks[0])
    assert len(verdict.regions) == 5
    assert len(asked) == 1
