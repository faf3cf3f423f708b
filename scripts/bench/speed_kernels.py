"""The kernels that a run spends its time in, each with its plain reference, a check of both, and what its arithmetic comes to.

Operations are additions, multiplications, divisions, roots, minima, maxima and comparisons on floating-point numbers, each counted once, of
the work that the answer needs; absolute values, copies and integers count nothing. A product that feeds an addition can be one fused
instruction: `slots` counts instructions so. The tables below are counted from the loops in `search/front/kernels.py` and `data/solids.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import population_scoring
import speed_plain
import torch
from scipy.spatial import KDTree
from torch.utils.flop_counter import FlopCounterMode

from imdim.data.families import PLAIN
from imdim.data.surfaces import surface_clouds
from imdim.data.synthesize import SynthesisConfig, draw_programs
from imdim.geometry import kernels as kernels_of_geometry
from imdim.geometry.lowering import lower
from imdim.geometry.metrics import chamfer, diagonal
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.sampling import leaf_surface
from imdim.learn.checkpoint import load_policy
from imdim.learn.decode import DecodeConfig, steps
from imdim.numbers.face_coordinates import move_limited, step_maps
from imdim.numbers.normal_equations import mask_determined, solve_blocks
from imdim.numbers.refine import RefineConfig, _linearise
from imdim.program.tree import KINDS, Primitive, Program, combine_all, leaves
from imdim.search.front.fitness import FitnessConfig, SampledTarget, Scorer
from imdim.search.front.kernels import fill_distances
from imdim.search.front.leaf_cache import LeafCache, Registry

CHECKPOINT = Path(__file__).parents[2] / "models" / "imdim-base.safetensors"
TRANSFORM, TRANSFORM_SLOTS = 18, 12  # a point in a leaf's frame: 3 subtractions, 9 products, 6 sums
DISTANCE = {"box": 16, "sphere": 7, "cylinder": 15, "cone": 36, "torus": 10, "ellipsoid": 23}
DISTANCE_SLOTS = {"box": 14, "sphere": 5, "cylinder": 13, "cone": 30, "torus": 8, "ellipsoid": 19}
ROOTS = {"box": 1, "sphere": 1, "cylinder": 2, "cone": 2, "torus": 2, "ellipsoid": 2}
# of the deciding leaf, per point: its frame, its derivative, the normal, the turn, the weight
TANGENT = 18 + 25 + 15 + 9 + 15
NORMAL_EQUATIONS = 9 * (1 + 2 + 2 * 9)  # weight times row, gradient, and one row of a [9, 9] matrix each
LEVELS = 18 + 12  # a point before one primitive: its frame, and the largest bound it violates
LEVEL_BYTES = 44 * 4  # `levels` and the fold pass over an array of [b, t, m] single-precision numbers 44 times, 22 to read
CANDIDATE = 60 + 2 * 18  # a point on a surface by three maps, turned with its normal


@dataclass(frozen=True)
class Work:
    """Of one call: operations, fused instructions and roots of a core without waiting, and bytes that go through memory at least."""

    flops: float
    slots: float = 0.0
    roots: float = 0.0
    bytes: float = 0.0


@dataclass(frozen=True)
class Kernel:
    """`run` is timed after `prepare`, which is not; `differs` compares the answers of `run` and `plain`: at most `tolerance`."""

    name: str
    what: str
    precision: Literal["single", "double"]
    work: Work
    prepare: Callable[[], Any]
    run: Callable[[Any], Any]
    plain: Callable[[], Any]
    differs: Callable[[Any, Any], float]
    tolerance: float


def population(trees: int, primitives: int = 16, points: int = 4096) -> Kernel:
    """Trees of which no leaf was ever seen: distances at half of the points, occupancy at the others."""
    rng = np.random.default_rng(0)
    surface, samples = rng.uniform(-1, 1, (2, points // 2, 3))
    w_in = (np.linalg.norm(samples, axis=1) < 0.8) / len(samples)
    evidence = SampledTarget(surface, 1.0, samples, w_in, 1 / len(samples) - w_in)
    config = FitnessConfig(capacity=trees * (primitives + 2))
    programs = [population_scoring.random_tree(rng, primitives) for _ in range(trees)]

    def scorer() -> Scorer:
        fresh = Scorer(evidence, config)
        for columns in (fresh.bits, fresh._distances):
            columns.table.fill(0)  # the pages are there, as they are in a run
        return fresh

    def differs(got: Any, expected: Any) -> float:
        return float(np.abs(np.subtract([s.error for s in got], expected)).max())

    return Kernel(
        "population",
        f"{trees} trees of {primitives} primitives at {points} points",
        "single",
        _population_work(programs, points),
        scorer,
        lambda fresh: fresh.score(programs),
        lambda: [population_scoring.plain(p, evidence, config) for p in programs],
        differs,
        1e-3,
    )


def _population_work(programs: list[Program], points: int) -> Work:
    parts = [leaf.kind for p in programs for leaf in leaves(p)]
    # half of the points are compared once per leaf, half are folded and averaged
    folded = (len(parts) - len(programs)) + 2 * len(programs)
    flops = points * sum(TRANSFORM + DISTANCE[k] for k in parts) + points // 2 * (len(parts) + folded)
    slots = points * sum(TRANSFORM_SLOTS + DISTANCE_SLOTS[k] for k in parts) + points // 2 * (len(parts) + folded)
    table = points // 2 * len(parts) * 4  # the rows of distances, written once and read once
    return Work(flops, slots, points * sum(ROOTS[k] for k in parts), 2 * table)


def leaf_table(trees: int, primitives: int = 16, points: int = 4096) -> Kernel:
    """The compiled part of population scoring that depends on the leaves: distances, in single precision."""
    rng = np.random.default_rng(0)
    parts = [population_scoring.random_leaf(rng) for _ in range(trees * primitives)]
    cloud, kinds = rng.uniform(-1, 1, (points, 3)), [p.kind for p in parts]
    columns = LeafCache(cloud, "distances", Registry(), len(parts))
    columns.of(parts)
    leaves_of, rows = columns_arguments(parts), np.arange(len(parts))
    flops = points * sum(TRANSFORM + DISTANCE[k] for k in kinds)
    slots = points * sum(TRANSFORM_SLOTS + DISTANCE_SLOTS[k] for k in kinds)
    return Kernel(
        "leaf table",
        f"{len(parts)} primitives at {points} points, the compiled loop alone",
        "single",
        Work(flops, slots, points * sum(ROOTS[k] for k in kinds), 4 * points * len(parts)),
        lambda: None,
        lambda _: (fill_distances(*leaves_of, columns._xyz, rows, columns.table), columns.table)[1],
        lambda: np.array([population_scoring.plain_leaf(part, cloud) for part in parts]),
        lambda got, expected: float(np.abs(got - expected).max()),
        1e-5,
    )


def columns_arguments(parts: list[Primitive]) -> tuple[np.ndarray, np.ndarray]:
    """Kinds [k] and rows [k, 15] of `fill_distances`."""
    rows = [(*p.size, *(0.0,) * (3 - len(p.size)), *p.center, *matrix_from_euler(p.rotation).T.ravel()) for p in parts]
    return np.array([KINDS.index(p.kind) for p in parts]), np.array(rows, np.float32)


def gradients(primitives: int = 16, points: int = 8192) -> Kernel:
    """The compiled part of the solver's step that depends on the leaves: values, and derivatives by the numbers of the deciding leaf."""
    program, cloud = _part_and_cloud(primitives, points)
    lowered, kinds = lower(program), [leaf.kind for leaf in leaves(program)]
    n = len(cloud)

    def differs(got: Any, expected: np.ndarray) -> float:
        leaf, value, tangent, _ = got
        chain = np.stack([speed_plain.tangent_from_params(part.rotation) for part in leaves(program)])
        exact = np.einsum("ni,nij->nj", tangent, chain[leaf])
        return float(np.abs(np.column_stack([value, exact]) - expected).max())

    return Kernel(
        "gradients",
        f"{primitives} primitives, {n} points, the compiled loop alone",
        "double",
        Work(*_gradient_flops(kinds, n), n * (sum(ROOTS[k] for k in kinds) + 2), n * 8 * (3 + 9 + 3 + 2)),
        lambda: None,
        lambda _: kernels_of_geometry.program_tangent(lowered, cloud),
        lambda: speed_plain.gradients(program, cloud),
        differs,
        1e-9,
    )


def _gradient_flops(kinds: list[str], n: int) -> tuple[float, float]:
    """Operations and slots of values and derivatives at `n` points."""
    flops = n * (sum(TRANSFORM + DISTANCE[k] for k in kinds) + len(kinds) - 1 + TANGENT)
    return flops, n * (sum(TRANSFORM_SLOTS + DISTANCE_SLOTS[k] for k in kinds) + len(kinds) - 1 + TANGENT)


def solver(primitives: int = 16, points: int = 8192) -> Kernel:
    """One step of Levenberg and Marquardt from a part whose numbers are a little off."""
    program, cloud = _part_and_cloud(primitives, points)
    config, start = RefineConfig(), lower(program)
    maps, scale = step_maps(start), config.start_scale * diagonal(cloud)

    def step(_: Any) -> np.ndarray:
        linear = _linearise(start, cloud, scale)
        found = solve_blocks(linear.matrix, linear.gradient, mask_determined(linear.matrix, config.min_support), 1e-3)
        move_limited(start, linear.maps, found)
        return found

    n, (flops, slots) = len(cloud), _gradient_flops([leaf.kind for leaf in leaves(program)], len(cloud))
    flops, slots = flops + n * NORMAL_EQUATIONS, slots + n * 9 * (1 + 1 + 9)
    roots = n * (sum(ROOTS[leaf.kind] for leaf in leaves(program)) + 2)
    moves = n * 8 * (3 + 2 * 9 + 2 * 3 + 4)
    return Kernel(
        "solver step",
        f"{primitives} primitives, {n} points",
        "double",
        Work(flops, slots, roots, moves),
        lambda: None,
        step,
        lambda: speed_plain.solver_step(program, maps, cloud, scale, 1e-3, config.min_support),
        lambda got, expected: float(np.abs(got - expected).max() / np.abs(expected).max()),
        1e-6,
    )


def _part_and_cloud(count: int, points: int) -> tuple[Program, np.ndarray]:
    """A union of primitives in a row, far enough apart that no point is equally near to two, and points near its surface."""
    rng = np.random.default_rng(1)
    parts = [population_scoring.random_leaf(rng) for _ in range(count)]
    apart = [Primitive(p.kind, p.size, (3.0 * i, *p.center[1:]), p.rotation) for i, p in enumerate(parts)]
    clouds = [leaf_surface(p, points // count, rng)[0] for p in apart]
    return combine_all("union", list[Program](apart)), np.concatenate([c + rng.normal(0, 0.01, c.shape) for c in clouds])


def distances(points: int) -> Kernel:
    """Chamfer distance of two clouds on a sphere. The arithmetic counted is that of comparing all pairs: what a share above 1 says is
    that no such comparison, however fast, would do on this core what the tree does."""
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(2, points, 3))
    a, b = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (a, b))
    return Kernel(
        "chamfer",
        f"2 x {points} points",
        "double",
        Work(9.0 * points * points, 6.0 * points * points, 0.0, 2 * 24 * points),
        lambda: None,
        lambda _: chamfer(a, b),
        lambda: speed_plain.chamfer(a, b),
        lambda got, expected: abs(got - expected) / expected,
        1e-12,
    )


def clouds(rows: int, points: int = 1024) -> Kernel:
    """Clouds of synthetic programs. The first round of candidates is counted; what rows still lack takes further ones."""
    families = ("plate", "bracket", "turned", "pattern", "shell", "free")  # whose kinds the plain code knows
    solids, _ = draw_programs(rows, SynthesisConfig(n_min=4, gt_points=256, families=families), torch.Generator().manual_seed(3))
    looks = float(2 * 2 * points * solids.kinds.numel())  # both sides of 2 n candidates, before every primitive

    def run(_: Any) -> torch.Tensor:
        return surface_clouds(solids, points, torch.Generator().manual_seed(4))[0]

    return Kernel(
        "cloud generation",
        f"{rows} programs of {solids.kinds.shape[1]} primitives at most, {points} points each",
        "single",
        Work(looks * LEVELS + rows * 2 * points * CANDIDATE, 0.0, looks, looks * LEVEL_BYTES),
        lambda: None,
        run,
        lambda: speed_plain.surface_cloud(solids, points, torch.Generator().manual_seed(4)),
        lambda got, expected: _missing(got.numpy(), expected),
        1e-3,
    )


def _missing(got: np.ndarray, expected: list[np.ndarray]) -> float:
    """Share of expected points that are not there: rounding decides the few that lie on an edge."""
    missing = sum(int((KDTree(cloud).query(points)[0] > 1e-5).sum()) for cloud, points in zip(got, expected, strict=True))
    return missing / sum(len(points) for points in expected)


def decoding(rows: int) -> Kernel:
    """The moves of the bundled policy along its own greedy decoding; products of matrices as torch counts them."""
    policy, _ = load_policy(CHECKPOINT)
    _, targets = draw_programs(rows, SynthesisConfig(n_min=2, n_max=6, gt_points=1024, families=PLAIN), torch.Generator().manual_seed(5))
    states = list(steps(policy, targets, DecodeConfig(max_primitives=4), torch.Generator().manual_seed(6)))

    def run(_: Any) -> list[Any]:
        return [policy.propose(s.seen) for s in states]

    with torch.no_grad(), FlopCounterMode(display=False) as counter:
        run(None)
    weights = sum(p.numel() * p.element_size() for p in policy.parameters())
    return Kernel(
        "decoding",
        f"{sum(len(s.rows) for s in states)} moves of {rows} targets in {len(states)} batches",
        "single",
        Work(float(counter.get_total_flops()), bytes=float(weights * len(states))),
        lambda: None,
        torch.no_grad()(run),
        torch.no_grad()(lambda: speed_plain.proposals(policy, states)),
        _other_moves,
        0.05,
    )


def _other_moves(got: Any, expected: Any) -> float:
    """Share of moves that are another token or primitive: near-ties are decided by rounding, which depends on the batch."""
    rows = [(move.tokens[i], move.part.centers[i, 0]) for move in got for i in range(len(move.tokens))]
    same = [
        bool(token == move.tokens[0]) and bool(torch.allclose(centre, move.part.centers[0, 0], atol=1e-3))
        for (token, centre), move in zip(rows, expected, strict=True)
    ]
    return 1 - sum(same) / len(same)


def kernels(size: float = 1.0) -> list[Kernel]:
    """All of them; `size` scales them for a quick look."""
    return [
        population(max(8, round(128 * size))),
        leaf_table(max(8, round(128 * size))),
        solver(points=max(1024, round(8192 * size))),
        gradients(points=max(1024, round(8192 * size))),
        distances(max(1024, round(8192 * size))),
        clouds(max(8, round(64 * size))),
        decoding(max(4, round(16 * size))),
    ]
