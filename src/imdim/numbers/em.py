"""The numbers of a program that make a noisy cloud most likely, by expectation and maximisation (Dempster, Laird & Rubin 1977).

Each round shares the points among samples of the program's own surface (`likelihood`), and moves the faces by what their samples were
given: the normal equations of `refine` with offsets in the place of distances. What the surface does not show has no samples and stays.
Before that, ends that only just meet a face are let through it: a step would open or close them; and none reaches far out of the cloud.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.finish.overshoot import overshoot
from imdim.geometry.lowering import Lowered, Outlines, lower
from imdim.geometry.point_grid import measure_diagonal
from imdim.geometry.rotations import matrix_from_euler
from imdim.numbers.face_coordinates import lift_numbers, shift_leaves, step_maps
from imdim.numbers.likelihood import MOST_SAMPLES, Noise, Responsibilities, SurfaceSamples, expectation_step, settle_clutter
from imdim.numbers.normal_equations import blocks
from imdim.numbers.outline_coordinates import OutlineCoordinates, center_leaf, outline_coordinates
from imdim.numbers.shared_rotations import TURNS, align_rotations, frames, map_shared_turns, swing_centers
from imdim.numbers.ties import Ties, find_ties
from imdim.program.outline import check_crossings
from imdim.program.tree import FLAT_ENDS, PRISMS, Primitive, Program, leaves, map_leaves

MOST_LET_THROUGH = 40  # leaves; the booleans that ask which ends only just meet grow with the square
NOISE_ROUNDS = 4
TIED = 1e7  # times what points know of a number at most, by which ties are held
RELAXED = 1.6  # any factor below 2 converges where 1 does (Salakhutdinov & Roweis 2003)


@dataclass(frozen=True)
class EMConfig:
    """Lengths are in units of the noise: a round whose longest step is shorter than `still` ends the work, none is longer than `far`."""

    rounds: int = 24
    still: float = 0.02
    calmer: float = 0.02  # share by which the noise must fall for a still round to be followed by another
    far: float = 3.0
    worse: float = 0.02  # nats per point above the best round at which the work ends
    window: int = 5  # rounds that together must be better than as many before them: of single ones the samples leave that in doubt
    better: float = 2e-4  # nats per point
    support: float = 12.0  # points that must show a direction of the numbers' space; it is held otherwise
    through: float = 6.0  # how far ends reach beyond what they meet; 0 leaves them
    samples: int = MOST_SAMPLES  # of the surface that show; where they are further apart than the noise is wide, ends of thin walls drift
    parallel_deg: float = 2.0  # leaves whose directions differ by less are taken to be parallel
    whole: bool = False  # whether the program has all its parts, so that what it does not explain is clutter


@dataclass(frozen=True)
class FittedProgram:
    """A fitted program, the noise that explains the points beside it, their mean negative log-density, the share of its surface whose
    wall is a `skin`, and how many ends of each leaf are `hidden`, unless that was not looked at."""

    program: Program
    noise: Noise
    nll: float
    rounds: int
    skin: float = 0.0
    hidden: tuple[int, ...] = ()


def maximise_likelihood(
    program: Program, points: np.ndarray, noise: Noise, config: EMConfig | None = None, deadline: Deadline = NEVER
) -> FittedProgram:
    """`program` with its numbers moved to make `points` [n, 3] most likely; `noise` is a first guess.

    Past the `deadline` (by default never) they stay as they are by then, and only the noise is fitted.
    """
    config, program = config or EMConfig(), map_leaves(program, lambda _, leaf: center_leaf(leaf))
    if config.through and not deadline.has_passed() and sum(1 for _ in leaves(program)) <= MOST_LET_THROUGH:
        reach = config.through * noise.sigma
        program = overshoot(clip_program(program, points, 2 * reach), reach=reach, deadline=deadline)
    start = lower(program)
    numbers = replace(start, rotations=align_rotations(start, config.parallel_deg))
    member = frames(numbers, config.parallel_deg)[0]
    ties = find_ties([*leaves(program)], numbers, member)
    # with what it is level with a ball goes round
    member[[i for i in ties.leaves if member[i] < 0]] = 0 if (member >= 0).any() else -1
    best, seen, told = FittedProgram(program, noise, np.inf, 0), None, list[float]()
    for done in range(config.rounds):
        trial = lift_numbers(program, start, numbers)
        shown = SurfaceSamples.of(trial, noise.sigma, config.samples, noise.shadows, seen)
        seen = shown.seen
        share = expectation_step(points, shown, noise)
        told.append(share.nll)
        if share.nll < best.nll:
            hidden = tuple(shown.count_hidden_ends(numbers).tolist())
            best = FittedProgram(trial, noise, share.nll, done, shown.skin, hidden)
        # a step knows nothing of the area: an end that no point holds may drift out of the cloud
        if not len(shown.points) or share.nll > best.nll + config.worse or _is_settled(told, config):
            break
        if deadline.has_passed():
            return _in_its_noise(best, points, share.noise, config.samples)
        if done == config.rounds - 1:  # nothing would look at what one step more leads to
            break
        calmer = share.noise.sigma < (1 - config.calmer) * noise.sigma
        noise = settle_clutter(points, share, noise) if config.whole else share.noise
        numbers, program, longest = _maximisation_step(numbers, program, (member, ties), shown, share, config)
        if longest < config.still * noise.sigma and not calmer:
            break
    return best


def _is_settled(told: Sequence[float], config: EMConfig) -> bool:
    """Whether the last rounds, with the negative log-densities that were `told`, are together hardly better than as many before them."""
    window = config.window
    if len(told) < 2 * window or len(told) % window:
        return False
    return sum(told[-window:]) > sum(told[-2 * window : -window]) - window * config.better


def clip_program(program: Program, points: np.ndarray, margin: float) -> Program:
    """The program with boxes and cylinders that end `margin` outside the box of `points` [n, 3] at the latest; inside, it is the same.

    What reaches further takes samples from the surface that is seen.
    """
    corners = np.array(list(product(*zip(points.min(0) - margin, points.max(0) + margin, strict=True))))
    return map_leaves(program, lambda _, leaf: _clip(leaf, corners))


def _clip(leaf: Primitive, corners: np.ndarray) -> Primitive:
    rotation, center, size = matrix_from_euler(leaf.rotation), np.array(leaf.center), list(leaf.size)
    for axis, slot in FLAT_ENDS[leaf.kind].items() if leaf.kind in PRISMS else ():
        along = (corners - np.array(leaf.center)) @ rotation[:, axis]
        start, end = max(-leaf.size[slot] / 2, float(along.min())), min(leaf.size[slot] / 2, float(along.max()))
        if end > start and end - start < leaf.size[slot]:
            size[slot] = end - start
            center = center + (start + end) / 2 * rotation[:, axis]
    return replace(leaf, size=tuple(size), center=tuple(center.tolist()))


def _in_its_noise(likely: FittedProgram, points: np.ndarray, noise: Noise, samples: int) -> FittedProgram:
    """The program with the noise that explains the points beside it, `noise` or later ones: under a first guess that is too small two
    sheets are likelier than the one surface that they blur into."""
    for _ in range(NOISE_ROUNDS):
        shown = SurfaceSamples.of(likely.program, noise.sigma, samples, noise.shadows)
        share = expectation_step(points, shown, noise)
        if share.nll >= likely.nll:
            break
        likely, noise = replace(likely, noise=noise, nll=share.nll, skin=shown.skin), share.noise
    return likely


def _maximisation_step(
    numbers: Lowered, program: Program, shared: tuple[np.ndarray, Ties], shown: SurfaceSamples, share: Responsibilities, config: EMConfig
) -> tuple[Lowered, Program, float]:
    """The maximisation step, the program with its outlines after it, and the longest move of a face in it.

    Unknowns are the faces' coordinates of each leaf without its rotation, one rotation per frame, and the coordinates of outlines. What
    leaves have `shared` are their frames and the ties of their numbers.
    """
    (member, ties), leaf = shared, shown.leaf
    tangent = kernels.leaf_tangent(numbers, shown.points, shown.normals, leaf)
    k, groups = len(numbers.kinds), int(member.max(initial=-1)) + 1
    plain = np.broadcast_to(np.eye(9), (k, 9, 9))
    matrix, gradient = blocks(leaf, tangent, share.offset, share.mass, plain)
    maps, turns = step_maps(numbers), map_shared_turns(numbers, member)
    basis = np.zeros((k, 9, TURNS * k + 3 * groups))
    size = max(measure_diagonal(shown.points) / 2, share.noise.sigma)
    for i in range(k):
        basis[i, :, TURNS * i : TURNS * (i + 1)] = maps[i, :, :TURNS]
        if member[i] >= 0:
            at = TURNS * k + 3 * member[i]
            basis[i, :, at : at + 3] = turns[i] / size
    whole = np.einsum("kai,kab,kbj->ij", basis, matrix, basis, optimize=True)
    slope = np.einsum("kai,ka->i", basis, gradient)
    drawn = _add_outlines(numbers, program, shown, share, (leaf, tangent, basis), (whole, slope))
    whole, slope = drawn.matrix, drawn.gradient
    if ties.twins:
        spans = {i: (first, first + coordinates.count) for i, coordinates, first in drawn.outlines}
        rows = ties.rows(numbers, maps, spans, len(whole))
        whole = whole + TIED * float(np.diag(whole).max(initial=1.0)) * (rows.T @ rows)
    # along those eigenvectors that enough points show, longer than asked: where walls blur, each round goes a part of the way
    values, vectors = np.linalg.eigh(whole)
    vectors, values = vectors[:, values >= config.support], values[values >= config.support]
    step = -RELAXED * vectors @ ((vectors.T @ slope) / values)
    longest = float(np.abs(step).max(initial=0.0))
    step *= min(1.0, config.far * share.noise.sigma / max(longest, 1e-300))
    program, outlines = _move_outlines(program, drawn.outlines, step)
    raw = np.einsum("kaj,j->ka", basis, step[: basis.shape[2]])
    own = np.einsum("kaj,j->ka", basis[:, 3:6, : TURNS * k], step[: TURNS * k])
    turned = step[TURNS * k : basis.shape[2]].reshape(-1, 3) / size
    centers = swing_centers(numbers, np.einsum("kij,kj->ki", numbers.rotations, own), member, turned)
    moved = replace(shift_leaves(numbers, raw), centers=centers)
    return (replace(moved, outlines=outlines) if drawn.outlines else moved), program, longest


@dataclass(frozen=True)
class _Drawn:
    """Normal equations with unknowns for outlines behind the others: leaf, coordinates, and the first unknown of each outline."""

    matrix: np.ndarray
    gradient: np.ndarray
    outlines: list[tuple[int, OutlineCoordinates, int]]


def _add_outlines(
    numbers: Lowered,
    program: Program,
    shown: SurfaceSamples,
    share: Responsibilities,
    rows: tuple[np.ndarray, np.ndarray, np.ndarray],
    equations: tuple[np.ndarray, np.ndarray],
) -> _Drawn:
    """The `equations` of all other unknowns with those of the outlines; `rows` are each sample's leaf, its tangent [m, 9], and the leaves'
    basis [k, 9, p]."""
    (leaf, tangent, basis), (matrix, gradient) = rows, equations
    drawn = [(i, outline_coordinates(part.outline, part.kind == "revolve"), part) for i, part in enumerate(leaves(program)) if part.outline]
    ends = np.cumsum([len(matrix), *(c.count for _, c, _ in drawn)])
    whole, slope = np.zeros((ends[-1], ends[-1])), np.zeros(ends[-1])
    whole[: len(matrix), : len(matrix)], slope[: len(gradient)] = matrix, gradient
    for (i, coordinates, part), first, last in zip(drawn, ends, ends[1:], strict=False):
        own = np.flatnonzero(leaf == i)
        places, normals = in_plane(part.kind, numbers.centers[i], numbers.rotations[i], shown.points[own], shown.normals[own])
        moves = -coordinates.rows(places, normals)
        weighed = moves.multiply(share.mass[own, None]).tocsr()
        # what moves a leaf as a whole are few of the unknowns
        moving = np.flatnonzero(basis[i].any(0))
        across = basis[i][:, moving].T @ (weighed.T @ tangent[own]).T
        whole[moving, first:last], whole[first:last, moving] = across, across.T
        whole[first:last, first:last] = (moves.T @ weighed).toarray()
        slope[first:last] = weighed.T @ share.offset[own]
    return _Drawn(whole, slope, [(i, coordinates, int(first)) for (i, coordinates, _), first in zip(drawn, ends, strict=False)])


def in_plane(kind: str, center: np.ndarray, rotation: np.ndarray, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals [n, 3] in the plane of the outline of a leaf [n, 2]; what stands on an end face has a normal of length 0."""
    local, along = (points - center) @ rotation, normals @ rotation
    if kind == "extrude":
        return local[:, :2], along[:, :2]
    radius = np.hypot(local[:, 0], local[:, 1])
    outward = (local[:, :2] * along[:, :2]).sum(1) / np.maximum(radius, 1e-300)
    return np.column_stack([radius, local[:, 2]]), np.column_stack([outward, along[:, 2]])


def _move_outlines(program: Program, drawn: list[tuple[int, OutlineCoordinates, int]], step: np.ndarray) -> tuple[Program, Outlines]:
    """The program and its outlines after a step; an outline that would bound nothing or cross itself stays."""
    after = {i: c.outline for i, c, _ in drawn}
    for i, coordinates, first in drawn:
        try:
            moved = coordinates.move(step[first : first + coordinates.count])
            check_crossings(moved)
            low, _ = moved.bounds
            if low[0] >= 0 or coordinates.outline.bounds[0][0] < 0:
                after[i] = moved
        except ValueError:
            continue
    moved = map_leaves(program, lambda i, leaf: replace(leaf, outline=after[i]) if i in after else leaf)
    return moved, Outlines.of([*leaves(moved)])
