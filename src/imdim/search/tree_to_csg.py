"""A volumetric decision tree as a CSG program of bounded primitives.

The path to a cell is an intersection of rules and the solid the union of the inside cells; rules that many paths share are
factored out. All plane rules of a path make one box where they are parallel or orthogonal, several intersected boxes
otherwise; a curved rule is its primitive, long enough to pass through the bounds. Of every subtree both readings are
built, its inside cells and its region minus its outside cells, and the cheaper one is kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry.rotations import euler_from_matrix, frame_from_axis
from imdim.geometry.surface import Surface, vec
from imdim.program.cost import cost
from imdim.program.rewrite.containment_rules import ContainmentProver
from imdim.program.rewrite.simplify import reduce_program
from imdim.program.tree import Combine, Primitive, Program, combine_all
from imdim.search.candidate_families import elliptic_solid
from imdim.search.decision_tree import Leaf, Split, Tree

PARALLEL_SINE = math.sin(math.radians(0.5))  # planes closer than this to parallel, or to a right angle, share a box
MARGIN = 0.05  # of the bounds' diagonal, by which unbounded rules reach out of the bounds
MAX_REDUCED = 64  # primitives; longer programs are left as they are until the end

# A side of a plane, n . x <= d, as (n, a point of the plane).
_Halfspace = tuple[np.ndarray, np.ndarray]
# What fills a region: all of it, none of it, or a program within it.
_Part = Program | bool


def to_program(tree: Tree, lower: np.ndarray, upper: np.ndarray, deadline: Deadline = NEVER) -> Program | None:
    """The program of the inside cells within the bounds `lower`, `upper` [3]; None where there is no inside cell.

    Past the `deadline` (by default never) it is no longer made shorter.

    Raises ValueError where the bounds are not in order.
    """
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    if not (upper > lower).all():
        raise ValueError(f"bounds need lower < upper, got {lower.tolist()} and {upper.tolist()}")
    bounds = _Bounds.of(lower, upper, deadline)
    part = _fill(tree, [], bounds)[0]
    if part is False:
        return None
    program = reduce_program(_whole(part, [], bounds), deadline=deadline)
    if ContainmentProver().contains(bounds.box, program):
        return program
    # unbounded rules reach out of the bounds, where nothing is known
    return reduce_program(Combine("intersection", program, bounds.box), deadline=deadline)


@dataclass(frozen=True)
class _Bounds:
    box: Primitive
    corners: np.ndarray  # [8, 3]
    margin: float
    deadline: Deadline

    @classmethod
    def of(cls, lower: np.ndarray, upper: np.ndarray, deadline: Deadline) -> _Bounds:
        box = Primitive("box", vec(upper - lower), vec((lower + upper) / 2))
        corners = np.array(list(product(*zip(lower, upper, strict=True))))
        return cls(box, corners, MARGIN * float(np.linalg.norm(upper - lower)), deadline)

    def extent(self, axis: np.ndarray, margin: float) -> tuple[float, float]:
        """From where to where the bounds reach along `axis`."""
        t = self.corners @ axis
        return float(t.min()) - margin, float(t.max()) + margin


def _fill(tree: Tree, region: list[_Halfspace], bounds: _Bounds) -> tuple[_Part, _Part]:
    """The inside and the outside of a subtree within its region of space."""
    if isinstance(tree, Leaf):
        return tree.inside, not tree.inside
    if tree.surface.kind == "plane":
        both = _across_plane(tree, region, bounds)
    else:
        rule = _solid(tree.surface, bounds)
        behind, ahead = (_fill(side, region, bounds) for side in (tree.behind, tree.ahead))
        both = tuple(_across_solid(rule, b, a, region, bounds) for b, a in zip(behind, ahead, strict=True))
    inside, outside = both
    return _cheaper(inside, outside, region, bounds), _cheaper(outside, inside, region, bounds)


def _across_plane(split: Split, region: list[_Halfspace], bounds: _Bounds) -> tuple[_Part, _Part]:
    normal, point = np.array(split.surface.axis), np.array(split.surface.point)
    regions = [[*region, (normal, point)], [*region, (-normal, point)]]
    behind, ahead = (_fill(side, r, bounds) for side, r in zip((split.behind, split.ahead), regions, strict=True))

    def join(b: _Part, a: _Part) -> _Part:
        if b is True and a is True:
            return True
        filled = [_whole(part, r, bounds) for part, r in zip((b, a), regions, strict=True) if part is not False]
        return _reduce(combine_all("union", filled), bounds) if filled else False

    return join(behind[0], ahead[0]), join(behind[1], ahead[1])


def _across_solid(rule: Primitive, behind: _Part, ahead: _Part, region: list[_Halfspace], bounds: _Bounds) -> _Part:
    if isinstance(behind, bool) and behind is ahead:
        return behind
    if behind is False:
        return _reduce(Combine("difference", _whole(ahead, region, bounds), rule), bounds)
    core = _whole(behind, region, bounds)
    within = Combine("intersection", rule, core)
    if ahead is False:
        return _reduce(within, bounds)
    if behind is True and isinstance(ahead, Primitive | Combine):
        # where the rule is all inside, what is ahead of it need not be cut
        return _reduce(Combine("union", ahead, within), bounds)
    around = Combine("difference", _whole(ahead, region, bounds), rule)
    return _reduce(Combine("union", around, core if ahead is True else within), bounds)


def _cheaper(part: _Part, rest: _Part, region: list[_Halfspace], bounds: _Bounds) -> _Part:
    """`part`, or its region minus the rest where that is shorter."""
    if isinstance(part, bool) or isinstance(rest, bool) or bounds.deadline.has_passed():
        return part
    carved = _reduce(Combine("difference", _whole(True, region, bounds), rest), bounds)
    return carved if cost(carved) < cost(part) else part


def _whole(part: _Part, region: list[_Halfspace], bounds: _Bounds) -> Program:
    """A part as a program; a full one is its region."""
    return part if isinstance(part, Primitive | Combine) else _reduce(_region_program(region, bounds), bounds)


def _reduce(program: Program, bounds: _Bounds) -> Program:
    return reduce_program(program, deadline=bounds.deadline) if cost(program) < 2 * MAX_REDUCED else program


def _solid(surface: Surface, bounds: _Bounds) -> Primitive:
    """The inside of a curved carrier, passing through the bounds where it is unbounded."""
    point, axis = np.array(surface.point), np.array(surface.axis)
    if surface.kind == "sphere":
        return Primitive("sphere", surface.sizes, surface.point)
    if surface.kind == "ellipsoid":
        return Primitive("ellipsoid", surface.sizes, surface.point, _tidy(euler_from_matrix(surface.frame)))
    if surface.kind == "elliptic":
        return elliptic_solid(surface, axis, *bounds.extent(axis, bounds.margin))
    rotation = _tidy(euler_from_matrix(frame_from_axis(axis)))
    if surface.kind == "torus":
        return Primitive("torus", surface.sizes, surface.point, rotation)
    start = float(point @ axis)
    low, high = (t - start for t in bounds.extent(axis, bounds.margin))
    if surface.kind == "cylinder":
        size: tuple[float, ...] = (surface.sizes[0], high - low)
    else:
        # the nappe in front of the apex
        low, high = max(low, 0.0), max(high, bounds.margin)
        slope = math.tan(surface.sizes[0])
        size = (low * slope, high * slope, high - low)
    return Primitive(surface.kind, tuple(float(s) for s in size), vec(point + axis * (low + high) / 2), rotation)


def _region_program(region: list[_Halfspace], bounds: _Bounds) -> Program:
    """The intersection of half-spaces, within the bounds, as few boxes as their directions allow; they may reach out of the bounds."""
    boxes: list[Program] = []
    left = list(region)
    while left:
        frame = _frame([n for n, _ in left])
        fits = [_axis_of(n, frame) is not None for n, _ in left]
        boxes.append(_box([h for h, fit in zip(left, fits, strict=True) if fit], frame, bounds))
        left = [h for h, fit in zip(left, fits, strict=True) if not fit]
    return combine_all("intersection", boxes) if boxes else bounds.box


def _frame(normals: list[np.ndarray]) -> np.ndarray:
    """An orthonormal frame [3, 3] along the first normal and the first one orthogonal to it, named nearest to x, y, z."""
    x = normals[0] / np.linalg.norm(normals[0])
    seeds = [*normals[1:], *np.eye(3)]
    y = next((n for n in seeds if abs(n @ x) < PARALLEL_SINE), None)
    y = frame_from_axis(x)[:, 0] if y is None else y - (y @ x) * x
    y = y / np.linalg.norm(y)
    columns = [x, y, np.cross(x, y)]
    order = max(permutations(range(3)), key=lambda p: sum(abs(columns[c][i]) for i, c in enumerate(p)))
    frame = np.stack([columns[c] * math.copysign(1.0, columns[c][i]) for i, c in enumerate(order)], axis=1)
    if np.linalg.det(frame) < 0:
        frame[:, np.argmin(abs(np.diag(frame)))] *= -1
    return frame


def _axis_of(normal: np.ndarray, frame: np.ndarray) -> tuple[int, float] | None:
    """The axis of `frame` along which `normal` points, and its sign; None if it points along none."""
    along = normal @ frame
    axis = int(np.argmax(abs(along)))
    return (axis, math.copysign(1.0, along[axis])) if np.linalg.norm(np.delete(along, axis)) < PARALLEL_SINE else None


def _box(halfspaces: list[_Halfspace], frame: np.ndarray, bounds: _Bounds) -> Primitive:
    """One box for half-spaces along the axes of `frame`; where none bounds it, it ends at the bounds or, turned, beyond them."""
    aligned = np.allclose(frame, np.eye(3), rtol=0, atol=1e-9)
    reach = np.array([bounds.extent(frame[:, i], 0.0 if aligned else bounds.margin) for i in range(3)])
    for normal, point in halfspaces:
        axis, sign = _axis_of(normal, frame) or (0, 1.0)
        t = float(point @ frame[:, axis])
        if sign > 0:
            reach[axis, 1] = min(reach[axis, 1], t)
        else:
            reach[axis, 0] = max(reach[axis, 0], t)
    size = np.maximum(reach[:, 1] - reach[:, 0], 1e-9 * bounds.margin)
    rotation = (0.0, 0.0, 0.0) if aligned else _tidy(euler_from_matrix(frame))
    return Primitive("box", vec(size), vec(frame @ reach.mean(1)), rotation)


def _tidy(euler_deg: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (0.0 if abs(a) < 1e-9 else a for a in euler_deg)
    return x, y, z
