"""Simple outlines in batches, and what is extruded and turned from them, against closed forms, programs' outlines and the exact solids."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial.transform import Rotation

from imdim.data.canonical import canonical_primitives
from imdim.data.dice import Dice
from imdim.data.outlines import (
    FORMS,
    NO_FORM,
    QUARTERS,
    SHARES_OF,
    SIDES,
    TURNS_OF,
    Family,
    corners,
    family_of,
    form_of,
    from_outline,
    mask_shares,
    measure_outlines,
    mirror,
    on_outlines,
    outline_levels,
    quarter_of,
    rounding,
    to_outline,
    turn,
)
from imdim.data.solids import (
    BOX,
    CYLINDER,
    EXTRUDE,
    REVOLVE,
    Solids,
    concatenate,
    euler_from_matrices,
    from_sequences,
    from_signed,
    holds,
    inside,
    to_sequences,
    to_signed,
)
from imdim.data.surfaces import bounds, surface_areas, surface_clouds, volumes
from imdim.geometry import kernels
from imdim.geometry.lowering import Outlines
from imdim.geometry.sdf import rotation_matrices
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, arc_radius, circle, flatten_loop, is_in_loop, rectangle, reverse_ring, ring_curves
from imdim.program.sequence import Step, to_program
from imdim.program.tree import Primitive

# family and shares; a rectangle is one without a radius, a slot one as round as it can be
OUTLINES = [
    *((Family.ROUNDED, (share, 0.0)) for share in (0.0, 0.4, 1.0)),
    *((family, (0.0, 0.0)) for family in SIDES),
    *((Family.ELL, (0.2, 0.45)), (Family.TEE, (0.3, 0.15)), (Family.CHANNEL, (0.12, 0.35))),
]
NAMED = pytest.mark.parametrize(("family", "shares"), OUTLINES, ids=lambda v: v.name if isinstance(v, Family) else str(v[0]))
TURNED = [(family, (*shares, inner)) for family, shares in OUTLINES if family not in SIDES for inner in (0.0, 0.4)]


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def double(*values):
    return torch.tensor(values, dtype=torch.float64)


def box_of(family, quarter=0):
    """Half edges of a box in which an outline is turned by a quarter."""
    return (0.5, 0.5) if family in SIDES else (0.3, 0.7) if quarter % 2 else (0.7, 0.3)


def form(family, quarter=0):
    return int(form_of(torch.tensor(int(family)), torch.tensor(quarter)))


def level_at(form, shares, half, points, to_axis=False):
    """Levels [n] of one outline at points [n, 2]."""
    u, v = points.T[:, None]
    each = torch.tensor([form]), double(*shares, *[0.0] * (3 - len(shares)))[None], double(*half)[None]
    return outline_levels(*each, u, v, torch.tensor([to_axis]))[0]


def plane(n, seed=0):
    return torch.rand(n, 2, generator=generator(seed), dtype=torch.float64) * 1.6 - 0.8


def rotated(points, quarters):
    return points @ torch.linalg.matrix_power(double((0, 1), (-1, 0)), quarters)


def closed_form(family, shares, w, h):
    """The area of an outline in a box of edges `w` and `h`."""
    a, b = shares
    if family in SIDES:
        n = SIDES[family]
        return n / 2 * (w / 2) ** 2 * math.sin(2 * math.pi / n)
    r = a * min(w, h) / 2
    return {
        Family.ROUNDED: w * h - (4 - math.pi) * r * r,
        Family.ELL: w * h - (1 - a) * w * (1 - b) * h,
        Family.TEE: w * b * h + a * w * (1 - b) * h,
        Family.CHANNEL: w * h - (1 - 2 * a) * w * (1 - b) * h,
    }[family]


@NAMED
@pytest.mark.parametrize("quarter", range(QUARTERS))
def test_areas_and_points_are_those_of_the_outline_of_a_program(family, shares, quarter):
    half, code = box_of(family, quarter), form(family, quarter)
    outline = to_outline(code, (*shares, 0.0), half)
    w, h = (2 * v for v in box_of(family))
    assert outline.area == pytest.approx(closed_form(family, shares, w, h), rel=1e-7)
    if family not in SIDES:
        low, high = outline.bounds
        assert (*low, *high) == pytest.approx((-half[0], -half[1], *half), abs=1e-9)
    points = plane(600)
    mine = level_at(code, shares, half, points)
    truth = [is_in_loop(outline.loops[0], x, y) for x, y in points.tolist()]
    assert (mine < 0).tolist() == truth
    assert 0.05 < np.mean(truth) < 0.95
    box = torch.tensor([code]), double(*shares, 0.0)[None], double(*half)[None]
    at, r = corners(*box), rounding(*box)
    area, around, middle, middle_of_edge = (float(v) for v in measure_outlines(at, r))
    ring = np.array(flatten_loop(outline.loops[0], 1440))
    assert area == pytest.approx(outline.area, rel=1e-7)
    assert around == pytest.approx(length_of(outline), rel=1e-7)
    assert middle == pytest.approx(centroid(ring)[0], abs=1e-4)
    edges = np.roll(ring, -1, 0) - ring
    long = np.linalg.norm(edges, axis=1)
    assert middle_of_edge == pytest.approx(((ring + edges / 2)[:, 0] * long).sum() / long.sum(), abs=1e-4)


def length_of(outline: Outline) -> float:
    curves = [c for ring in outline.rings for c in ring_curves(ring)]
    return sum(math.dist(c[:2], c[2:4]) if not c[4] else arc_radius(c) * 4 * abs(math.atan(c[4])) for c in curves)


def centroid(ring: np.ndarray) -> np.ndarray:
    """Of the area within a polygon."""
    following = np.roll(ring, -1, 0)
    cross = ring[:, 0] * following[:, 1] - following[:, 0] * ring[:, 1]
    return ((ring + following) * cross[:, None]).sum(0) / (3 * cross.sum())


def test_bars_lie_where_the_families_say():
    """Walls of L at -x, floors and bars at -y, a U open to +y; worked by hand in a box from -1 to 1."""
    upright, corner, across, middle = (-0.9, 0.9), (0.9, 0.9), (0.9, -0.9), (0.0, 0.9)
    places = double(upright, corner, across, middle)
    known = {Family.ELL: [True, False, True, False], Family.TEE: [False, False, True, True], Family.CHANNEL: [True, True, True, False]}
    for family, expected in known.items():
        assert (level_at(form(family), (0.2, 0.2), (1.0, 1.0), places) < 0).tolist() == expected
    # the first share is of the wall, the second of the floor
    thick = double((-1 + 0.59, 0.5), (-1 + 0.61, 0.5), (0.5, -1 + 0.19), (0.5, -1 + 0.21))
    assert (level_at(form(Family.ELL), (0.3, 0.1), (1.0, 1.0), thick) < 0).tolist() == [True, False, True, False]


@NAMED
def test_quarter_turns_and_mirror_images_are_those_of_the_plane(family, shares):
    points, flat, tall = plane(500), box_of(family), box_of(family, 1)
    shares = (*shares, 0.3)
    for quarter in range(QUARTERS):
        code = form(family, quarter)
        upright, here = level_at(form(family), shares, flat, points), (flat, tall)[quarter % 2]
        assert torch.allclose(level_at(code, shares, here, rotated(points, quarter)), upright, atol=1e-6)
        further = int(turn(torch.tensor(code), torch.tensor(3)))
        assert further == form(family, quarter + 3)
        assert ((level_at(further, shares, (tall, flat)[quarter % 2], rotated(points, quarter + 3)) < 0) == (upright < 0)).all()
        other, swapped = (v.tolist() for v in mirror(torch.tensor(code), double(*shares)))
        image = level_at(other, swapped, here, points * double(1, -1))
        assert torch.allclose(image, level_at(code, shares, here, points), atol=1e-6)
        again, back = mirror(torch.tensor(other), double(*swapped))
        assert (int(again), tuple(back.tolist())) == (code, shares)


def test_the_same_outline_has_one_form():
    """As many forms differ as quarter turns do, and each is told apart by points of the plane; what has no form keeps none."""
    points = plane(2000)
    families, quarters = torch.arange(len(Family)).repeat_interleave(8), torch.arange(8).repeat(len(Family))
    codes = form_of(families, quarters)
    assert torch.equal(family_of(codes), families)
    assert 1 <= int(codes.min()) <= int(codes.max()) < FORMS
    for family in Family:
        mine = codes[families == family]
        assert len(mine.unique()) == TURNS_OF.get(family, QUARTERS)
        assert torch.equal(form_of(family_of(mine), quarter_of(mine)), mine)
        solids = [tuple((level_at(int(c), (0.2, 0.3), (0.5, 0.5), points) < 0).tolist()) for c in mine]
        assert len(set(solids)) == len(mine.unique())
        assert solids[:4] == solids[4:]
    none, shares = torch.tensor([NO_FORM]), torch.zeros(1, 3)
    assert mirror(none, shares)[0].tolist() == turn(none, torch.tensor([1])).tolist() == [NO_FORM]


@pytest.mark.parametrize("family", Family, ids=lambda f: f.name)
def test_shares_that_are_used_are_those_that_change_the_solid(family):
    code, base = form(family), (0.3, 0.4, 0.5)
    for turned in (False, True):
        used = mask_shares(torch.tensor([code]), torch.tensor([turned]))[0].tolist()
        assert used == [k < SHARES_OF.get(family, 0) for k in range(2)] + [turned]
        points = torch.rand(1, 4000, 3, generator=generator(), dtype=torch.float64) * 2.4 - 1.2
        for k, is_used in enumerate(used):
            more = tuple(v + 0.2 * (i == k) for i, v in enumerate(base))
            one, other = (part(REVOLVE if turned else EXTRUDE, family, shares) for shares in (base, more))
            assert bool((holds(one, points) != holds(other, points)).any()) == is_used
    assert not mask_shares(torch.tensor([NO_FORM]), torch.tensor([True])).any()


@NAMED
def test_points_are_spread_evenly_along_an_outline(family, shares):
    half = box_of(family, 1)
    code = form(family, 1)
    outline = to_outline(code, (*shares, 0.0), half)
    box = torch.tensor([code]), double(*shares, 0.0)[None], double(*half)[None]
    at, r = (v.expand(20_000, *v.shape[1:]) for v in (corners(*box), rounding(*box)))
    pick, bend = torch.rand(2, 20_000, generator=generator(), dtype=torch.float64)
    points, normals = on_outlines(at, r, box[2].expand(20_000, 2), pick, bend)
    # both sides of a point, along its normal, against a program's kernels
    curves = Outlines.of([Primitive("extrude", (1.0,), outline=outline)]).curves
    out, within = (kernels.outline_sdf(curves, (points + step * normals).numpy()) for step in (1e-6, -1e-6))
    assert np.abs(out + within).max() < 1e-6
    assert (out - within > 1e-6).mean() > 0.999
    even = np.array(flatten_loop(outline.loops[0], 1440))
    line = np.diff(np.concatenate([even, even[:1]]), axis=0)
    steps = np.linalg.norm(line, axis=1)
    place = np.linspace(0, steps.sum(), 40_000, endpoint=False)
    edge = np.searchsorted(np.cumsum(steps), place, side="right").clip(0, len(steps) - 1)
    known = even[edge] + line[edge] * ((place - (np.cumsum(steps) - steps)[edge]) / steps[edge])[:, None]
    for axis in range(2):
        for quantile in (0.13, 0.31, 0.52, 0.71, 0.88):
            edge_of = np.quantile(known[:, axis], quantile)
            below, level = ((v[:, axis] < edge_of - 1e-6).mean() for v in (points.numpy(), known))
            assert below == pytest.approx(level, abs=0.015)


def part(kind, family, shares, quarter=0, center=(0.0, 0.0, 0.0), rotation=None, height=0.9):
    """One extruded or turned outline in double precision, as a batch."""
    half = box_of(family, quarter)
    size = (2 * half[0], 2 * half[1], height) if kind == EXTRUDE else (2 * half[0], 2 * half[1], 0.0)
    matrix = torch.eye(3, dtype=torch.float64) if rotation is None else rotation
    plain = Solids.plain(
        torch.tensor([[kind]]), torch.tensor([[True]]), double(*center)[None, None], double(*size)[None, None], matrix[None, None]
    )
    return replace(plain, forms=torch.tensor([[form(family, quarter)]]), shares=double(*shares)[None, None])


MOVED = {"center": (0.2, -0.1, 0.3), "rotation": rotation_matrices(double(25.0, 40.0, -70.0))}
PARTS = [(EXTRUDE, family, (*shares, 0.0), quarter) for quarter, (family, shares) in zip([0, 1, 2, 3] * 3, OUTLINES, strict=False)]
PARTS += [(REVOLVE, family, shares, quarter) for quarter, (family, shares) in zip([3, 0, 1, 2] * 3, TURNED, strict=True)]


def name_of(value):
    return (
        value.name
        if isinstance(value, Family)
        else {EXTRUDE: "extruded", REVOLVE: "turned"}.get(value, str(value))
        if isinstance(value, int)
        else str(value)
    )


@pytest.mark.parametrize(("kind", "family", "shares", "quarter"), PARTS, ids=name_of)
def test_rows_are_extruded_and_turned_outlines(kind, family, shares, quarter):
    """Membership, bounds, cloud, normals and evenness of each, turned and moved, against the exact solid."""
    solids = part(kind, family, shares, quarter, **MOVED)
    exact = to_program(to_signed(solids)[0])
    assert isinstance(exact, Primitive)
    assert exact.kind == ("extrude" if kind == EXTRUDE else "revolve")
    points = torch.rand(1, 4000, 3, generator=generator(3), dtype=torch.float64) * 3 - 1.5 + double(*exact.center)
    distance = kernels.program_sdf(exact, points[0].numpy())
    found = inside(solids, holds(solids, points))[0].numpy()
    assert (found == (distance < 0))[np.abs(distance) > 1e-6].all()
    assert found.any()
    mesh = to_trimesh(to_manifold(exact))
    low, high = bounds(solids)
    assert (mesh.bounds[0] >= low[0].numpy() - 1e-6).all()
    assert (mesh.bounds[1] <= high[0].numpy() + 1e-6).all()
    single = replace(solids, **{n: getattr(solids, n).float() for n in ("centers", "sizes", "rotations", "shares")})
    cloud, normals, count = surface_clouds(single, 6000, generator())
    assert int(count) == 6000
    on, step = cloud[0].double().numpy(), 1e-3 * normals[0].double().numpy()
    assert np.abs(kernels.program_sdf(exact, on)).max() < 1e-4
    risen = kernels.program_sdf(exact, on + step) - kernels.program_sdf(exact, on - step)
    assert np.quantile(risen, 0.02) > 1.6e-3
    even = trimesh.sample.sample_surface(mesh, 40_000, seed=1)[0]
    for axis in range(3):
        for quantile in (0.1, 0.3, 0.5, 0.7, 0.9):
            assert (on[:, axis] < np.quantile(even[:, axis], quantile)).mean() == pytest.approx(quantile, abs=0.03)


@pytest.mark.parametrize(("kind", "family", "shares", "quarter"), PARTS, ids=name_of)
def test_areas_and_volumes_are_those_of_the_exact_parts(kind, family, shares, quarter):
    solids = part(kind, family, shares, quarter)
    mesh = to_trimesh(to_manifold(to_program(to_signed(solids)[0])))
    assert float(volumes(solids)) == pytest.approx(mesh.volume, rel=2e-3)
    assert float(surface_areas(solids)) == pytest.approx(mesh.area, rel=2e-3)


def scattered(n=1):
    """Every part of PARTS in `n` random poses, one to a row."""
    rows = [part(*given, rotation=r) for given in PARTS for r in Dice(generator(7), n).rotations().double()]
    return concatenate(rows, 1)


def test_canonical_numbers_keep_extruded_and_turned_parts():
    raw = scattered(6)
    again = canonical_primitives(raw)
    points = torch.rand(len(raw.kinds), 800, 3, generator=generator(2), dtype=torch.float64) * 1.8 - 0.9
    assert (holds(raw, points) == holds(again, points)).float().mean() > 0.99999
    assert torch.allclose(volumes(raw), volumes(again))
    # the axis up, the angle of a spin at most an eighth of a turn
    axis = again.rotations[:, 0, :, 2]
    assert (axis.gather(1, axis.abs().argmax(1, keepdim=True)) > 0).all()
    assert not torch.allclose(again.rotations, raw.rotations, atol=0.1)
    twice = canonical_primitives(again)
    assert torch.equal(twice.forms, again.forms)
    for name in ("sizes", "rotations", "shares"):
        assert torch.allclose(getattr(twice, name), getattr(again, name), atol=1e-9)


@pytest.mark.parametrize("over", [False, True])
def test_canonical_numbers_forget_how_an_outline_was_written(over):
    """The same solids on their heads, in quarter turns, with numbers that mean nothing, and turned ones spun anyhow."""
    raw = scattered(6)
    n = len(raw.kinds)
    dice = Dice(generator(5), n)
    spun, quarters = raw.kinds[:, 0] == REVOLVE, dice.integers(0, 3)
    angle = torch.where(spun, dice.uniform(0.0, 360.0).double(), -90.0 * quarters)
    about = rotation_matrices(torch.stack([torch.full_like(angle, 180.0 * over), torch.zeros_like(angle), torch.zeros_like(angle)], 1))
    about = about @ rotation_matrices(torch.stack([torch.zeros_like(angle), torch.zeros_like(angle), angle], 1))
    forms, shares = mirror(raw.forms, raw.shares) if over else (raw.forms, raw.shares)
    forms = torch.where(spun[:, None], forms, turn(forms, quarters[:, None]))
    flipped = (~spun & (quarters % 2 == 1))[:, None, None]
    sizes = torch.where(flipped, raw.sizes[..., [1, 0, 2]], raw.sizes)
    unused = ~mask_shares(forms, raw.kinds == REVOLVE) * 0.7
    other = replace(raw, rotations=raw.rotations @ about[:, None], forms=forms, shares=shares + unused, sizes=sizes)
    points = torch.rand(n, 400, 3, generator=generator(2), dtype=torch.float64) * 1.8 - 0.9
    assert torch.equal(holds(raw, points), holds(other, points))
    one, two = canonical_primitives(raw), canonical_primitives(other)
    assert torch.equal(one.forms, two.forms)
    for name in ("sizes", "rotations", "shares"):
        assert torch.allclose(getattr(one, name), getattr(two, name), atol=1e-6)


def test_outlines_come_back_from_sequences():
    raw = scattered()
    tokens, params = to_sequences(raw, 3)
    assert params.shape[2] == 15
    back = from_sequences(tokens, params)
    assert torch.equal(back.forms, raw.forms)
    for name in ("sizes", "shares", "centers"):
        assert torch.allclose(getattr(back, name), getattr(raw, name))
    assert np.allclose(
        Rotation.from_matrix(back.rotations[:, 0]).as_matrix(), Rotation.from_matrix(raw.rotations[:, 0]).as_matrix(), atol=1e-6
    )
    assert torch.allclose(rotation_matrices(euler_from_matrices(raw.rotations)), raw.rotations, atol=1e-6)
    plain = from_sequences(tokens.clamp_max(4), params[..., :10])
    assert (plain.forms == NO_FORM).all()
    assert not plain.shares.any()


@pytest.mark.parametrize(("kind", "family", "shares", "quarter"), PARTS, ids=name_of)
def test_parts_of_programs_are_read_as_the_outlines_that_they_are(kind, family, shares, quarter):
    """From the exact part, and from its outline begun elsewhere, the other way round and off its middle; rectangles are plainer things."""
    solids = part(kind, family, shares, quarter, **MOVED)
    exact = to_signed(solids)[0][0].term
    assert exact.outline is not None
    (ring,) = exact.outline.rings
    begun = reverse_ring((*ring[2:], *ring[:2]))
    dx, dy = (0.0, 0.2) if kind == REVOLVE else (0.3, 0.2)
    shift = MOVED["rotation"].numpy() @ (np.array([0, 0, dy]) if kind == REVOLVE else np.array([dx, dy, 0]))
    moved = replace(exact, outline=Outline((begun,)).shift(dx, dy), center=tuple(np.array(exact.center) - shift))
    points = torch.rand(1, 3000, 3, generator=generator(3), dtype=torch.float64) * 3 - 1.5 + double(*exact.center)
    for given in (exact, moved):
        back = from_signed([(Step("union", given),)])
        assert ((holds(back, points) == holds(solids, points)).float().mean()) > 0.9999
        if shares[0] == 0.0 and family == Family.ROUNDED:
            assert back.kinds.item() in ((BOX,) if kind == EXTRUDE else (CYLINDER, REVOLVE))
            continue
        one, two = canonical_primitives(back), canonical_primitives(solids)
        assert torch.equal(one.kinds, two.kinds)
        assert torch.equal(one.forms, two.forms)
        for name in ("centers", "sizes", "rotations", "shares"):
            assert torch.allclose(getattr(one, name), getattr(two, name), atol=1e-6), name


def test_outlines_that_are_no_simple_ones_are_refused():
    square = rectangle(1.0, 1.0).rings[0]
    bent = (*square[:3], (-0.5, 0.2, 0.0), (-0.2, -0.1, 0.0))
    others = [
        Outline((square, circle(0.2))),
        Outline((bent,)),
        Outline((Ellipse(0.5, 0.2),)),
        Outline(((*square[:1], (0.5, -0.5, 0.3), *square[2:]),)),  # one side is an arc
        Outline(((*square[:3], (-0.5, 0.4, 0.0), (-0.4, 0.4, 0.0), (-0.4, -0.4, 0.0)),)),
    ]
    for outline in others:
        assert from_outline(outline) is None
        with pytest.raises(ValueError, match="extrude: not one of the simple outlines"):
            from_signed([(Step("union", Primitive("extrude", (0.4,), outline=outline)),)])
    ell = to_outline(form(Family.ELL), (0.3, 0.2, 0.0), (0.4, 0.5), 1.0)
    for kind, size in (("revolve", (90.0,)), ("drafted", (0.3, 4.0))):
        with pytest.raises(ValueError, match=f"{kind}: not one of the simple outlines"):
            from_signed([(Step("union", Primitive(kind, size, outline=ell)),)])
