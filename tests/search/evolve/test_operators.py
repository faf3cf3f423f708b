"""Every operator makes valid trees within the bounds, the same ones from the same generator, and does what its name says."""

import numpy as np
import pytest
from program_samples import random_program
from tests.drawn import BRACKET, PULLEY, centred
from tests.planted import PARTS, box, cut, cylinder, sphere, union
from tests.search.evolve.scenes import planted_scene, scene_of

from imdim.geometry.kernels import inside, program_sdf
from imdim.program.paths import leaf_paths
from imdim.program.rewrite.containment import bounding_radius
from imdim.program.tree import Combine, Primitive, Program, check_size, leaves, map_leaves
from imdim.search.evolve.numbers import face_at, jitter, share_number, snap_number
from imdim.search.evolve.operators import MUTATIONS, _shorten, crossover, hull, merge, move, remove, split, substitute
from imdim.search.evolve.scene import Scene

NAME = "rounded plate"
BLIND = scene_of(PARTS[NAME], 2_000, detected=False)
CLOUD = np.random.default_rng(0).uniform(-60, 60, (4000, 3))


def parents(scene: Scene, rng: np.random.Generator) -> list[Program]:
    """The planted program, random trees in the part's box, and one primitive."""

    def placed(leaf: Primitive) -> Primitive:
        x, y, z = leaf.center
        return Primitive(leaf.kind, tuple(30 * s for s in leaf.size), (40 * x, 30 * y, 4 * z), leaf.rotation)

    solids = ("box", "sphere", "cylinder", "cone", "torus")
    wild = [map_leaves(random_program(rng, k, kinds=solids), lambda _, p: placed(p)) for k in (2, 5, 9)]
    return [PARTS[NAME], *wild, box(50, 30, 4)]


def check(program: Program, scene: Scene) -> None:
    for leaf in leaves(program):
        check_size(leaf.kind, leaf.size)
        center = np.asarray(leaf.center)
        outside = np.linalg.norm(np.maximum(np.maximum(scene.bounds[0] - center, center - scene.bounds[1]), 0))
        assert np.isfinite([*leaf.center, *leaf.rotation]).all()
        assert outside <= bounding_radius(leaf)
        assert max(leaf.size) < 1e3 * scene.diagonal


@pytest.mark.parametrize("name", MUTATIONS)
@pytest.mark.parametrize("scene", [planted_scene(NAME), BLIND], ids=["detected", "blind"])
def test_mutants_are_valid_within_bounds_and_repeatable(name, scene):
    mutate = MUTATIONS[name][1]
    applied = 0
    for seed in range(8):
        for parent in parents(scene, np.random.default_rng(seed)):
            child = mutate(parent, scene, np.random.default_rng(seed))
            assert child == mutate(parent, scene, np.random.default_rng(seed))
            if child is not None:
                check(child, scene)
                applied += child != parent
    needs_surfaces = name in ("add_best", "refit", "regrow", "snap")
    assert applied == 0 if needs_surfaces and scene.families is None else applied >= 8


@pytest.mark.parametrize("seed", range(10))
def test_children_of_two_are_made_of_their_parents(seed):
    scene, rng = planted_scene(NAME), np.random.default_rng(seed)
    a, b = parents(scene, rng)[1:3]
    child = crossover(a, b, scene.scorer, np.random.default_rng(seed))
    assert child == crossover(a, b, scene.scorer, np.random.default_rng(seed))
    if child is not None:
        assert set(leaves(child)) <= set(leaves(a)) | set(leaves(b))
        assert set(leaves(child)) & set(leaves(b))


def test_crossover_takes_the_region_that_the_other_parent_explains():
    left, right = cylinder(8, 10, (-30.0, 0.0, 0.0)), box(12, 12, 12, (30.0, 0.0, 0.0))
    scene = scene_of(union(left, right), 8_000)
    rough = [box(20, 20, 14, (-30.0, 0.0, 0.0)), sphere(4, (30.0, 0.0, 0.0))]
    a, b = union(left, rough[1]), union(rough[0], right)
    children = [crossover(a, b, scene.scorer, np.random.default_rng(seed)) for seed in range(10)]
    assert min(s.volume for s in scene.scorer.score([c for c in children if c])) < 1e-9


def test_removal_takes_leaves_away():
    for seed in range(20):
        child = remove(PARTS[NAME], BLIND, np.random.default_rng(seed))
        assert child is not None
        assert set(leaves(child)) < set(leaves(PARTS[NAME]))
    assert remove(box(1, 1, 1), BLIND, np.random.default_rng(0)) is None


@pytest.mark.parametrize("leaf", [box(10, 20, 30, rotation=(10.0, 20.0, 30.0)), cylinder(5, 20, (3.0, 0.0, 0.0), (40.0, 0.0, 0.0))])
@pytest.mark.parametrize("index", [0, 1])
def test_two_halves_are_the_whole(leaf, index):
    axis = 2 if leaf.kind == "cylinder" else index
    index = 1 if leaf.kind == "cylinder" else index
    low, high = (_shorten(leaf, index, axis, end, 0.3) for end in (0, 1))
    assert low is not None
    assert high is not None
    assert low.size[index] == pytest.approx(0.3 * leaf.size[index])
    sure = np.abs(program_sdf(low, CLOUD)) > 1e-9
    assert (inside(union(low, high), CLOUD) == inside(leaf, CLOUD))[sure].all()
    assert not (inside(low, CLOUD) & inside(high, CLOUD)).any()


def test_halves_of_a_cone_are_the_cone():
    cone = Primitive("cone", (12.0, 4.0, 30.0), (1.0, 2.0, 3.0), (30.0, 50.0, 0.0))
    halves = [_shorten(cone, 2, 2, end, 0.4) for end in (0, 1)]
    assert (inside(union(*[h for h in halves if h]), CLOUD) == inside(cone, CLOUD)).all()


def test_a_split_adds_one_primitive():
    for seed in range(10):
        child = split(box(40, 20, 10), BLIND, np.random.default_rng(seed))
        assert child is None or len(list(leaves(child))) == 2


@pytest.mark.parametrize("seed", range(20))
def test_a_hull_holds_both(seed):
    rng = np.random.default_rng(seed)
    a, b = (p for p in leaves(parents(BLIND, rng)[1]))
    joint = hull(a, b)
    if a.kind == "torus":
        assert joint is None
        return
    assert joint is not None
    # a cylinder around a box is as wide as its edges, not its corners: half-size copies have none that stick out
    small = [Primitive(p.kind, tuple(0.5 * s for s in p.size), p.center, p.rotation) for p in (a, b)]
    held = inside(union(*small), CLOUD)
    if a.kind == "box":
        assert (inside(joint, CLOUD) | ~held).all()
    else:
        assert inside(joint, CLOUD)[held].mean() > 0.7 if held.any() else True


def test_a_merger_has_one_leaf_fewer():
    for seed in range(10):
        child = merge(PARTS[NAME], BLIND, np.random.default_rng(seed))
        assert child is not None
        assert len(list(leaves(child))) == 5


def test_substitutes_are_of_the_same_extent():
    seen = set()
    for seed in range(60):
        child = substitute(cylinder(10, 30), BLIND, np.random.default_rng(seed))
        if isinstance(child, Primitive) and child.center == (0, 0, 0):
            seen.add(child.kind)
            assert bounding_radius(child) <= 1.5 * bounding_radius(cylinder(10, 30))
    assert seen >= {"box", "sphere", "cone", "torus"}


def test_a_move_keeps_the_leaves():
    kept = 0
    for seed in range(20):
        child = move(PARTS[NAME], BLIND, np.random.default_rng(seed))
        assert child is not None
        kept += sorted(map(repr, leaves(child))) == sorted(map(repr, leaves(PARTS[NAME])))
    assert kept == 20


def test_steps_follow_the_local_error():
    good, bad = cylinder(6, 4, (-24.0, 14.0, 0.0)), box(60, 28, 9)
    errors = BLIND.local_errors(union(bad, good))
    assert errors[0] > 2 * errors[1]
    moves = [jitter(union(bad, good), BLIND, np.random.default_rng(s)) for s in range(60)]
    changed = [m.left != bad for m in moves if isinstance(m, Combine)]
    assert np.mean(changed) > 0.7


def test_a_moved_face_leaves_the_other_where_it_is():
    leaf = box(10, 20, 30, (1.0, 2.0, 3.0), (20.0, 30.0, 40.0))
    longer = face_at(leaf, 2, 2, 1, 5.0)
    assert longer is not None
    assert longer.size == (10, 20, 35)
    assert (inside(longer, CLOUD) | ~inside(leaf, CLOUD)).all()
    back = face_at(longer, 2, 2, 1, -5.0)
    assert back is not None
    assert back.center == pytest.approx(leaf.center)
    assert face_at(leaf, 2, 2, 0, -31.0) is None


def test_snapping_finds_the_drawn_numbers():
    scene = planted_scene(NAME)
    off = union(box(60, 28, 4), box(48, 40.6, 4, (0.0, 0.3, 0.0)))
    children = {snap_number(off, scene, np.random.default_rng(s)) for s in range(80)}
    exact = [leaf.size for c in children if c for leaf in leaves(c)]
    assert any(size == pytest.approx((48, 40, 4)) for size in exact)
    radii = [leaf.size[0] for s in range(60) if (c := snap_number(cylinder(5.7, 4), scene, np.random.default_rng(s))) for leaf in leaves(c)]
    assert any(r == pytest.approx(6) for r in radii)


def test_shared_values_become_equal():
    pair = cut(box(30, 30, 10), cylinder(3, 20), cylinder(3.1, 20, (8.0, 1.0, 0.0)))
    seen = {"radius": False, "axis": False}
    for seed in range(300):
        child = share_number(pair, BLIND, np.random.default_rng(seed))
        if child:
            cuts = [leaf for _, leaf in leaf_paths(child) if leaf.kind == "cylinder"]
            seen["radius"] |= cuts[0].size[0] == cuts[1].size[0]
            seen["axis"] |= cuts[0].center[:2] == pytest.approx(cuts[1].center[:2])
    assert all(seen.values())


@pytest.mark.parametrize("name", MUTATIONS)
def test_leaves_with_outlines_keep_them(name):
    """An operator may take such a leaf out, and move or scale it; the shape that it is drawn from stays."""
    plate, pulley = centred(BRACKET, 8.0), PULLEY
    parent = cut(union(plate, box(50, 30, 4), box(20, 20, 9)), pulley)
    shapes = {shape(plate), shape(pulley)}
    drawn = 0
    for seed in range(30):
        child = MUTATIONS[name][1](parent, planted_scene(NAME), np.random.default_rng(seed))
        found = [leaf for leaf in leaves(child) if leaf.outline is not None] if child is not None else []
        assert {shape(leaf) for leaf in found} <= shapes
        drawn += len(found)
    assert drawn > 0


def shape(leaf: Primitive) -> tuple[float, ...]:
    """What is left of an outline whatever its scale."""
    assert leaf.outline is not None
    (left, low), (right, _) = leaf.outline.bounds
    return tuple(
        round(x / (right - left), 9) for curve in leaf.outline.curves for x in (curve[0] - left, curve[1] - low, curve[4] * (right - left))
    )
