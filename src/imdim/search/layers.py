"""Bodies in layers: where all faces lie along one direction or across it, the sections between two levels tell all there is.

A plane arrangement that holds every wall of such a body has too many faces where the walls are many: bodies that were traced, cut from
sheets or printed in layers. Here each layer is drawn by itself, from the corners of its section, and goes on through all layers that
hold it, so that a boss begins where the plate that carries it does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from manifold3d import CrossSection, Manifold, OpType

from imdim.geometry.polygon_arcs import draw_ring
from imdim.geometry.rotations import euler_from_matrix
from imdim.geometry.solid import SEGMENTS, draw_section
from imdim.geometry.surface import vec
from imdim.program.cost import count_charged_curves
from imdim.program.outline import Outline, check_crossings, orient_loops
from imdim.program.plain_outlines import to_simple
from imdim.program.tree import Primitive, Program, combine_all

SQUARE = 2e-3  # cosine, by which a normal leaves the direction, or the plane across it
SLANTED = 1e-3  # of the surface, that may lie otherwise
MOST_LAYERS = 40
ONE_LEVEL = 4e-4  # of the unit frame
HARDLY = 1e-3  # of a section, that may lie outside of one that holds it
LEAST_AREA = 1e-6  # of the unit frame, that a loop encloses
FINER = (1.0, 0.25, 0.0)  # times the tolerance, with which a section is drawn until no curve crosses another


@dataclass(frozen=True)
class Layers:
    """The `sections` of a body between neighbouring `levels` [n + 1] along an `axis` of its frame; their coordinates are those of the next
    axis and the one after it. `walls` is the area of its surface that lies along the axis."""

    axis: int
    levels: np.ndarray
    sections: tuple[CrossSection, ...]
    walls: float

    @property
    def frame(self) -> np.ndarray:
        """The turn [3, 3] whose columns are those axes."""
        return _frame(self.axis)


def _frame(axis: int) -> np.ndarray:
    return np.eye(3)[:, [(axis + 1) % 3, (axis + 2) % 3, axis]]


@dataclass(frozen=True)
class _Prism:
    """An outline from the layer `first` up to before the layer `last`, as it is drawn."""

    outline: Outline
    drawn: CrossSection
    first: int
    last: int


def find_layers(normals: np.ndarray, areas: np.ndarray, solid: Manifold) -> Layers | None:
    """The layers of a `solid` in the unit frame, by the normals [f, 3] and areas [f] of its triangles, along the axis of that frame which
    most of the surface lies across; None where it is in none, or in too many."""
    flat, upright = np.abs(normals) > 1 - SQUARE**2, np.abs(normals) < SQUARE
    across = (areas[:, None] * flat).sum(0)
    possible = (areas[:, None] * ~(flat | upright)).sum(0) <= SLANTED * areas.sum()
    if not possible.any():
        return None
    axis = int(np.argmax(np.where(possible, across, -1.0)))
    turned = solid.transform(np.column_stack([_frame(axis).T, np.zeros(3)]))
    levels = _levels(turned)
    if len(levels) > MOST_LAYERS + 1:
        return None
    sections = tuple(turned.slice((low + high) / 2) for low, high in pairwise(levels.tolist()))
    walls = float(areas[upright[:, axis]].sum())
    return None if any(section.area() <= LEAST_AREA for section in sections) else Layers(axis, levels, sections, walls)


def _levels(solid: Manifold) -> np.ndarray:
    """The heights of corners, each once."""
    heights = np.unique(np.asarray(solid.to_mesh64().vert_properties)[:, 2])
    parted = np.append(True, np.diff(heights) > ONE_LEVEL)
    groups = np.cumsum(parted) - 1
    return np.bincount(groups, heights) / np.bincount(groups)


def draw_layers(layers: Layers, tolerance: float, price: float, curve: float) -> Program | None:
    """The union of the sections, drawn with lines and arcs that pass their corners within a `tolerance`, without those that are not worth
    their price in volume: that of a feature, and that of a charged `curve`. None where one of them cannot be drawn."""
    outlines = [_draw(section, tolerance) for section in layers.sections]
    prisms: list[_Prism] = []
    for i, outline in enumerate(outlines):
        if outline is None:
            return None
        prism = _Prism(outline, draw_section(outline, SEGMENTS), *_reach(layers, i))
        if not any(_is_one(prism, other) for other in prisms):
            prisms.append(prism)
    return combine_all("union", [_place(prism, layers) for prism in _worth_keeping(prisms, layers, price, curve)])


def _draw(section: CrossSection, tolerance: float) -> Outline | None:
    polygons = [np.asarray(polygon, float) for polygon in section.to_polygons()]
    for share in FINER:
        loops = [draw_ring(polygon, max(share * tolerance, 1e-9)) for polygon in polygons if _area(polygon) > LEAST_AREA]
        try:
            outline = Outline(orient_loops([loop for loop in loops if loop]))
            check_crossings(outline)
        except ValueError:
            continue
        return outline
    return None


def _area(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


def _reach(layers: Layers, at: int) -> tuple[int, int]:
    """The layers around one whose sections hold its own."""
    section = layers.sections[at]

    def is_held(k: int) -> bool:
        return (section - layers.sections[k]).area() <= HARDLY * section.area()

    first, last = at, at + 1
    while first > 0 and is_held(first - 1):
        first -= 1
    while last < len(layers.sections) and is_held(last):
        last += 1
    return first, last


def _is_one(one: _Prism, other: _Prism) -> bool:
    apart = (one.drawn - other.drawn).area() + (other.drawn - one.drawn).area()
    return (one.first, one.last) == (other.first, other.last) and apart <= HARDLY * one.drawn.area()


def _worth_keeping(prisms: Sequence[_Prism], layers: Layers, price: float, curve: float) -> list[_Prism]:
    """Those whose loss would cost more volume than they do, the cheapest to lose taken first."""
    kept = list(prisms)
    while len(kept) > 1:
        losses = [_loss(prism, [p for p in kept if p is not prism], layers) - _price(prism, price, curve) for prism in kept]
        least = int(np.argmin(losses))
        if losses[least] >= 0:
            break
        del kept[least]
    return kept


def _price(prism: _Prism, price: float, curve: float) -> float:
    return price + curve * count_charged_curves(prism.outline.curve_count)


def _loss(prism: _Prism, others: Sequence[_Prism], layers: Layers) -> float:
    """The volume by which the union of the others is farther from the body without a prism than with it."""
    lost = 0.0
    for k in range(prism.first, prism.last):
        covers = [other.drawn for other in others if other.first <= k < other.last]
        alone = prism.drawn - CrossSection.batch_boolean(covers, OpType.Add) if covers else prism.drawn
        inside = (alone ^ layers.sections[k]).area()
        lost += float(layers.levels[k + 1] - layers.levels[k]) * (2 * inside - alone.area())
    return lost


def _place(prism: _Prism, layers: Layers) -> Primitive:
    (left, low), (right, high) = prism.outline.bounds
    x, y = (left + right) / 2, (low + high) / 2
    bottom, top = float(layers.levels[prism.first]), float(layers.levels[prism.last])
    center = layers.frame @ np.array([x, y, (bottom + top) / 2])
    leaf = Primitive("extrude", (top - bottom,), vec(center), euler_from_matrix(layers.frame), prism.outline.shift(-x, -y))
    return to_simple(leaf) or leaf
