"""Where edge features lie in a program, as whoever has compiled kernels finds it, and as another process reads it without them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from imdim.geometry.blended_edge import BlendedEdge, Interval, Track
from imdim.program.edges import EdgeFeature
from imdim.program.tree import Program


@dataclass(frozen=True)
class PlacedEdges:
    """The `edges` of a program's features, and for each whether both faces reach as far as its blend does."""

    edges: tuple[BlendedEdge, ...] = ()
    has_room: tuple[bool, ...] = ()

    @staticmethod
    def of(program: Program, features: Sequence[EdgeFeature]) -> PlacedEdges:
        """Those of a program."""
        from imdim.geometry.edges import find_edges, has_room  # with them come compiled kernels, a second of a process
        from imdim.geometry.lowering import lower

        edges, solid = find_edges(program, features).edges, lower(program)
        return PlacedEdges(edges, tuple(has_room(solid, edge) for edge in edges))

    @staticmethod
    def from_rows(rows: Sequence[Sequence[Any]]) -> PlacedEdges:
        """What `rows` were of."""
        read = [(_read_edge(*row), has_room) for *row, has_room in rows]
        return PlacedEdges(tuple(edge for edge, _ in read), tuple(room for _, room in read))

    @property
    def pairs(self) -> list[tuple[BlendedEdge, bool]]:
        """Each edge, and whether it has room."""
        return list(zip(self.edges, self.has_room, strict=True))

    @property
    def rows(self) -> list[list[Any]]:
        """Each edge as numbers, lists and words, for JSON."""
        return [[*_write_edge(edge), room] for edge, room in self.pairs]


def _write_edge(edge: BlendedEdge) -> list[Any]:
    track = edge.track
    curve = [track.origin.tolist(), track.frame.tolist(), track.normals.tolist(), float(track.radius)]
    return [edge.feature, edge.edge, curve, [*edge.stretch], [*edge.sizes], edge.kind, [*edge.goes_on]]


def _read_edge(feature: int, edge: int, curve: Any, stretch: Any, sizes: Any, kind: Any, goes_on: Any) -> BlendedEdge:
    *arrays, radius = curve
    low, high, sides, is_convex, is_closed = stretch
    track = Track(*(np.array(values) for values in arrays), radius=radius)
    return BlendedEdge(feature, edge, track, Interval(low, high, tuple(sides), is_convex, is_closed), tuple(sizes), kind, tuple(goes_on))
