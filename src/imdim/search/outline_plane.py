"""The plane arrangement behind outlines: lines and circles cut a plane into faces, and an outline is a union of them.

Along a direction, planes parallel to it and cylinders about it are lines and circles of the plane across (`extrude`). About an axis, the
surfaces of revolution about it and the planes across are lines and circles of the half plane (radius, height) (`revolve`). The faces are
named as cells are, by the side of every wall that a point lies on, so that each cell knows its face.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.spatial import KDTree

from imdim.geometry.components import components
from imdim.geometry.rows import lengths
from imdim.search.cells import Cells
from imdim.search.kernels import group_rows
from imdim.search.outline_kernels import Graph

TANGENT, MOST = 3e-4, 8e-4  # of the unit frame: by how much a wall that is meant to touch a circle may miss it, at least and at most
SAGITTA = 0.012  # of the radius, between these: the circle is drawn through the corners of facets
SAME_NODE, BEYOND = 6e-4, 1e-3  # of the unit frame: within which crossings are one, and where pieces are told apart that leave one
ARC_CORNERS = 9  # of an arc where it stands for a polygon
OVAL_CORNERS = 65  # of half an ellipse, where it stands for one
ASIDE = 1.5e-4  # of the unit frame, from a segment to the points that tell its faces
WINDOW = -1  # the wall of segments on the edge of what is searched
OUTSIDE = -1  # the face there
AXIS = WINDOW  # the window's left edge, which is the axis of what is turned
_NONE, _NO_PAIRS = np.empty(0, np.int64), np.empty((0, 2), np.int64)
ANY_SIDE = np.empty(0, np.int8)
NO_SEGMENTS = Graph(_NONE, np.empty(0, bool), _NONE, _NO_PAIRS, _NO_PAIRS, np.empty(0), _NONE, _NONE, ANY_SIDE)


@dataclass(frozen=True)
class Walls:
    """Lines ``normal . p = offset`` [l, 2], [l] and circles [c, 2], [c] of a plane, and the window [2, 2] that is looked at.

    A circle that `ovals` has the semi-axes of, as columns [2, 2], is an ellipse. No other wall may come near it: only whole ellipses can be
    drawn.

    `columns` says by which codes of cells the sides are known: (direction, offset index) for a line between slabs, else (curved surface,
    None).
    """

    normals: np.ndarray
    offsets: np.ndarray
    centers: np.ndarray
    radii: np.ndarray
    window: np.ndarray
    columns: tuple[tuple[int, int | None], ...]
    ovals: Mapping[int, np.ndarray] = field(default_factory=dict)

    @cached_property
    def lines(self) -> tuple[np.ndarray, np.ndarray]:
        """Normals [l + 4, 2] and offsets [l + 4] of the lines, the window's edges last."""
        (left, low), (right, high) = self.window
        normals = np.concatenate([self.normals.reshape(-1, 2), [[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]])
        return normals, np.concatenate([self.offsets, [left, right, low, high]])

    def around(self, circle: int, turns: np.ndarray) -> np.ndarray:
        """The points [n, 2] of a circle, or an ellipse, at angles [n]."""
        ray = np.stack([np.cos(turns), np.sin(turns)], axis=-1)
        return self.centers[circle] + (ray @ self.ovals[circle].T if circle in self.ovals else self.radii[circle] * ray)

    def sides(self, points: np.ndarray) -> np.ndarray:
        """Flags [n, l + c] of points [n, 2]: in front of a line, within a circle."""
        front = points @ self.normals.T > self.offsets
        within = lengths(points[:, None] - self.centers) < self.radii
        for circle, axes in self.ovals.items():
            within[:, circle] = lengths((points - self.centers[circle]) @ np.linalg.inv(axes).T) < 1
        return np.concatenate([front, within], axis=1)

    def sides_of(self, cells: Cells) -> np.ndarray:
        """The same flags [m, l + c] of cells, by their codes."""
        out = np.empty((len(cells.points), len(self.columns)), bool)
        for i, (column, at) in enumerate(self.columns):
            out[:, i] = cells.inside[:, column] if at is None else cells.slabs[:, column] >= at
        return out


@dataclass(frozen=True)
class Segments:
    """Pieces of walls between crossings, those of a wall in order: the `wall` [s], the nodes at both ends [s, 2], the faces to the left
    and right [s, 2], and the `length` [s]. A line has the side in front of it on its left, a circle runs counter-clockwise."""

    wall: np.ndarray
    nodes: np.ndarray
    faces: np.ndarray
    length: np.ndarray


@dataclass(frozen=True)
class OutlinePlane:
    """A plane arrangement: `frame` [3, 3] has the columns (u, v, normal), `origin` [3] is where (0, 0) lies.

    An extrusion's normal, drafted or not, is along `direction`; of a turned outline u is the radius, v the height along it.
    """

    kind: str
    direction: int
    origin: np.ndarray
    frame: np.ndarray
    walls: Walls
    nodes: np.ndarray
    segments: Segments
    codes: np.ndarray  # packed sides of each face, sorted; faces apart may have the same
    polygons: list[np.ndarray]  # edges [e, 2, 2] of the outer ring of each face

    @property
    def faces(self) -> int:
        return len(self.codes)

    @cached_property
    def graph(self) -> Graph:
        """The segments as the compiled loops take them; along an axis no curve is drawn."""
        wall, faces = self.segments.wall, np.where(self.segments.faces == OUTSIDE, self.faces, self.segments.faces)
        starts = np.flatnonzero(np.append(True, wall[1:] != wall[:-1]))
        free = (wall[starts] == AXIS) & (self.kind == "revolve")
        order = np.argsort(faces, axis=None, kind="stable")
        ends = np.searchsorted(faces.reshape(-1)[order], np.arange(self.faces + 2))
        of_segment = np.cumsum(np.append(False, wall[1:] != wall[:-1]))
        starts = np.append(starts, len(wall))
        return Graph(starts, free, of_segment, self.segments.nodes, faces, self.segments.length, ends, order // 2, self.sides)

    @property
    def sides(self) -> np.ndarray:
        """On which side of each segment [s] what it bounds has to lie; nothing for walls that bound what is on either."""
        return ANY_SIDE

    @cached_property
    def _met(self) -> dict[tuple[int, int], list[np.ndarray]]:
        """What `cross` has told."""
        return {}

    def cross(self, a: int, b: int) -> list[np.ndarray]:
        """Where two walls of segments cross or touch, points [2]; many outlines turn there."""
        if (a, b) not in self._met:
            self._met[a, b] = cross_walls(self.walls, a, b)
        return self._met[a, b]

    def boundary(self, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Indices [b] of the segments that bound a region, and their nodes [b, 2] in the order that has the region on the left."""
        sides = np.append(inside, False)[self.segments.faces]
        at = np.flatnonzero(sides[:, 0] != sides[:, 1])
        nodes = self.segments.nodes[at]
        return at, np.where(sides[at, :1], nodes, nodes[:, ::-1])

    def project(self, points: np.ndarray) -> np.ndarray:
        """Points [n, 3] in the plane [n, 2], turned into the half plane about an axis."""
        away = points - self.origin
        if self.kind != "revolve":
            return away @ self.frame[:, :2]
        height = away @ self.frame[:, 1]
        return np.stack([lengths(away - height[:, None] * self.frame[:, 1]), height], axis=1)

    def faces_of(self, cells: Cells) -> np.ndarray:
        """The face [m] of each cell: of a sliver that tangents and merged crossings leave no room for, the face that fewest walls part it
        from, OUTSIDE where these are more than one; of a cell whose code several faces have, the face that holds its point, or where
        walls lean the nearest."""
        packed = _pack(self.walls.sides_of(cells))
        one_of, member = group_rows(packed.view(np.uint64).reshape(len(packed), packed.itemsize // 8))
        codes = packed[one_of]
        first, last = (np.searchsorted(self.codes, codes, side) for side in ("left", "right"))
        face = np.where(last > first, np.minimum(first, self.faces - 1), OUTSIDE)
        own, others = (_unpack(c, len(self.walls.columns)) for c in (self.codes, codes[face == OUTSIDE]))
        parted = others @ (1 - own).T + (1 - others) @ own.T
        face[face == OUTSIDE] = np.where(parted.min(1, initial=len(own)) <= 1, parted.argmin(1), OUTSIDE)
        out = face[member]
        for code in np.flatnonzero(last - first > 1).tolist():
            which = np.flatnonzero(member == code)
            points = self.project(cells.points[which])
            if self.kind == "drafted":  # at other levels a face lies a little beside where it is drawn
                away = [_distances(self.polygons[f], points) for f in range(first[code], last[code])]
                out[which] = first[code] + np.argmin(away, axis=0)
                continue
            for f in range(first[code], last[code]):
                out[which[_holds(self.polygons[f], points)]] = f
        return out


def frame_across(along: np.ndarray, guide: np.ndarray) -> np.ndarray:
    """Columns (u, v, along), right-handed; along the coordinate axes where `along` is one of them."""
    if np.abs(along).max() > 1 - 1e-12 and along.max() > 0:
        lead = int(np.argmax(along))
        return np.eye(3)[:, [(lead + 1) % 3, (lead + 2) % 3, lead]]
    u = guide - (guide @ along) * along
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(along, u), along], axis=1)


def corners_of(box: np.ndarray) -> np.ndarray:
    """The eight corners [8, 3] of a box [2, 3]."""
    return np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def window_across(box: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Low and high corner [2, 2] of a box [2, 3] as seen along what is across two `axes` [3, 2]."""
    corners = corners_of(box) @ axes
    return np.stack([corners.min(0), corners.max(0)])


def pack_graphs(planes: Sequence[OutlinePlane]) -> tuple[Graph, np.ndarray]:
    """The segments of all planes one after the other, and where each array of each plane begins [p + 1, 8]."""
    graphs = [NO_SEGMENTS, *(plane.graph for plane in planes)]
    firsts = np.cumsum([[len(array) for array in graph] for graph in graphs], axis=0)
    return Graph(*(np.concatenate(arrays) for arrays in zip(*graphs, strict=True))), firsts


def make_plane(kind: str, direction: int, origin: np.ndarray, frame: np.ndarray, walls: Walls) -> OutlinePlane | None:
    """The arrangement of walls; None where they bound no face."""
    nodes, pieces = _cut(walls)
    if not pieces:
        return None
    wall = np.array([w for w, _, _ in pieces])
    ends = np.array([pair for _, pair, _ in pieces])
    length, sides, kept = _look_beside(walls, nodes, pieces)
    ring = _rings(walls, nodes, pieces, length)
    # what lies on the left of a ring: its longest piece tells, short ones may lie where walls all but coincide
    teller = _longest(ring, np.repeat(length, 2))
    codes, polygons, face_of = _faces(ring, _pack(sides[teller]), kept.reshape(-1)[teller], _Polygons(walls, nodes, pieces))
    faces = face_of[ring].reshape(-1, 2)
    real = (faces[:, 0] != faces[:, 1]) & (ends[:, 0] != ends[:, 1])
    segments = Segments(wall[real], ends[real], faces[real], length[real])
    return OutlinePlane(kind, direction, origin, frame, walls, nodes, segments, codes, polygons) if real.any() else None


_Piece = tuple[int, tuple[int, int], tuple[float, float]]  # wall, nodes, parameters: lengths along a line, angles of a circle


def _cut(walls: Walls) -> tuple[np.ndarray, list[_Piece]]:
    """The nodes [n, 2] where walls cross, and the pieces between them; the window's four edges are walls too."""
    crossings = list(_crossings(walls))
    # a circle that nothing crosses, or once, still needs two nodes
    for c, (center, radius) in enumerate(zip(walls.centers, walls.radii, strict=True)):
        ends = (
            walls.around(c, np.array([np.pi, 0.0])) if c in walls.ovals else [center + side * radius * np.eye(2)[0] for side in (-1.0, 1.0)]
        )
        crossings += [(_circle(walls, c), _circle(walls, c), end) for end in ends]
    points = np.array([p for _, _, p in crossings])
    low, high = walls.window[0] - SAME_NODE, walls.window[1] + SAME_NODE
    inside = ((points >= low) & (points <= high)).all(1)
    label, nodes = _merge(points[inside])
    members: dict[int, set[int]] = {}
    artificial: dict[int, set[int]] = {}
    for (a, b, _), node in zip((c for c, keep in zip(crossings, inside, strict=True) if keep), label.tolist(), strict=True):
        for wall in {a, b}:
            (artificial if a == b else members).setdefault(wall, set()).add(node)
    for wall, extra in artificial.items():
        if len(members.get(wall, ())) < 2:
            members.setdefault(wall, set()).update(extra)
    pieces: list[_Piece] = []
    for wall in sorted(members):
        pieces += _pieces_of(walls, wall, np.array(sorted(members[wall])), nodes)
    return nodes, pieces


def _circle(walls: Walls, index: int) -> int:
    return len(walls.offsets) + 4 + index


def _crossings(walls: Walls) -> Iterator[tuple[int, int, np.ndarray]]:
    """(wall, wall, point [2]) of all crossings and touches; the window's edges stand between the lines and the circles."""
    count = len(walls.offsets) + 4 + len(walls.radii)
    for i in range(count):
        for j in range(i + 1, count):
            yield from ((i, j, point) for point in _cross(walls, i, j))


def cross_walls(walls: Walls, a: int, b: int) -> list[np.ndarray]:
    """Where two walls of segments cross or touch, points [2]; walls that are all but tangent touch between their crossings."""
    lines = len(walls.offsets)
    places = [wall + 4 if wall >= lines else wall if wall >= 0 else lines + WINDOW - wall for wall in (a, b)]
    points = _cross(walls, min(places), max(places))
    if len(points) < 2:
        return points
    radius = min(float(walls.radii[wall - lines]) for wall in (a, b) if wall >= lines)
    chord = float(np.linalg.norm(points[0] - points[1]))
    return [(points[0] + points[1]) / 2] if chord * chord <= 8 * radius * _slack(radius) else points


def _cross(walls: Walls, i: int, j: int) -> list[np.ndarray]:
    normals, offsets = walls.lines
    lines = len(offsets)
    if {i - lines, j - lines} & walls.ovals.keys():
        return []
    if i >= lines:
        return _circle_crossings(walls, i - lines, j - lines)
    if j < lines:
        det = normals[i, 0] * normals[j, 1] - normals[i, 1] * normals[j, 0]
        if abs(det) <= 1e-4:
            return []
        x = (offsets[i] * normals[j, 1] - offsets[j] * normals[i, 1]) / det
        return [np.array([x, (normals[i, 0] * offsets[j] - normals[j, 0] * offsets[i]) / det])]
    center, radius = walls.centers[j - lines], walls.radii[j - lines]
    gap = offsets[i] - normals[i] @ center
    along = np.array([normals[i, 1], -normals[i, 0]])
    return [center + gap * normals[i] + half * along for half in _halves(radius, abs(gap))]


def _halves(radius: float, gap: float) -> tuple[float, ...]:
    """Half chords with their signs; one of no length where the circle is touched."""
    if gap >= radius:
        return (0.0,) if gap - radius <= _slack(radius) else ()
    half = float(np.sqrt(radius * radius - gap * gap))
    return (-half, half)


def _slack(radius: float) -> float:
    """By how much a wall may miss a circle that it is taken to touch."""
    return float(np.clip(SAGITTA * radius, TANGENT, MOST))


def _circle_crossings(walls: Walls, c: int, d: int) -> list[np.ndarray]:
    (p, r), (q, s) = (walls.centers[c], walls.radii[c]), (walls.centers[d], walls.radii[d])
    apart = float(np.linalg.norm(q - p))
    slack = _slack(min(r, s))
    if apart < 1e-9 or apart > r + s + slack or apart < abs(r - s) - slack:
        return []
    along = (q - p) / apart
    if apart >= r + s or apart <= abs(r - s):
        return [p + (r if apart >= r + s or r > s else -r) * along]
    reach = (apart * apart + r * r - s * s) / (2 * apart)
    half = np.sqrt(max(r * r - reach * reach, 0.0)) * np.array([-along[1], along[0]])
    return [p + reach * along + half, p + reach * along - half]


def _merge(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The group [n] of each point, and the groups' middles [g, 2]."""
    pairs = KDTree(points).query_pairs(SAME_NODE, output_type="ndarray")
    count, label = components(pairs[:, 0], pairs[:, 1], len(points))
    sums = np.stack([np.bincount(label, points[:, k], count) for k in (0, 1)], axis=1)
    return label, sums / np.bincount(label, minlength=count)[:, None]


def _pieces_of(walls: Walls, wall: int, members: np.ndarray, nodes: np.ndarray) -> list[_Piece]:
    lines = len(walls.offsets) + 4
    if wall < lines:
        normal = walls.lines[0][wall]
        at = nodes[members] @ np.array([normal[1], -normal[0]])
        order = np.argsort(at)
        name = wall if wall < lines - 4 else WINDOW - (wall - lines + 4)
        ordered, at = members[order].tolist(), at[order].tolist()
        return [(name, (a, b), (s, t)) for a, b, s, t in zip(ordered, ordered[1:], at, at[1:], strict=False)]
    away = nodes[members] - walls.centers[wall - lines]
    if wall - lines in walls.ovals:
        away = away @ np.linalg.inv(walls.ovals[wall - lines]).T
    at = np.arctan2(away[:, 1], away[:, 0])
    order = np.argsort(at)
    ordered, at = members[order].tolist(), at[order].tolist()
    ends = [*at[1:], at[0] + 2 * np.pi]
    return [(wall - 4, (a, b), (s, t)) for a, b, s, t in zip(ordered, [*ordered[1:], ordered[0]], at, ends, strict=True)]


def _look_beside(walls: Walls, nodes: np.ndarray, pieces: Sequence[_Piece]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lengths [s], sides [2 s, w] left and right of each piece, and whether these lie in the window [s, 2]."""
    wall, lines = np.array([w for w, _, _ in pieces]), len(walls.offsets)
    ends, at = np.array([pair for _, pair, _ in pieces]), np.array([pair for _, _, pair in pieces])
    round_ = wall >= lines
    circle = np.where(round_, wall - lines, 0)
    radius = walls.radii[circle] if len(walls.radii) else np.zeros(len(wall))
    normals = walls.lines[0][np.where(wall < 0, lines + WINDOW - wall, np.where(round_, 0, wall))]
    turn = at.mean(1)
    outward = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    left = np.where(round_[:, None], -outward, normals)
    middle = nodes[ends].mean(1)
    if len(walls.radii):
        middle = np.where(round_[:, None], walls.centers[circle] + radius[:, None] * outward, middle)
    length = np.where(round_, radius, 1.0) * (at[:, 1] - at[:, 0])
    for i in np.flatnonzero(round_ & np.isin(circle, list(walls.ovals))).tolist():
        middle[i], left[i], length[i] = _look_beside_oval(walls, int(circle[i]), float(turn[i]))
    aside = np.minimum(ASIDE, 0.25 * length)[:, None] * left
    points = np.stack([middle + aside, middle - aside], axis=1).reshape(-1, 2)
    sides = walls.sides(points)
    own = np.flatnonzero(wall >= 0)
    sides[2 * own, wall[own]], sides[2 * own + 1, wall[own]] = True, False
    inside = ((points > walls.window[0]) & (points < walls.window[1])).all(1)
    return length, sides, inside.reshape(-1, 2)


def _look_beside_oval(walls: Walls, circle: int, turn: float) -> tuple[np.ndarray, np.ndarray, float]:
    """The point [2] of an ellipse at an angle, the normal [2] to its inside there, and half its length."""
    axes = walls.ovals[circle]
    outward = np.linalg.inv(axes).T @ (math.cos(turn), math.sin(turn))
    ring = walls.around(circle, np.linspace(0, np.pi, OVAL_CORNERS))
    half = float(np.linalg.norm(np.diff(ring, axis=0), axis=1).sum())
    return walls.around(circle, np.array([turn]))[0], -outward / np.linalg.norm(outward), half


def _rings(walls: Walls, nodes: np.ndarray, pieces: Sequence[_Piece], length: np.ndarray) -> np.ndarray:
    """The ring [2 s] to which each piece belongs, passed forwards (2 i) and backwards (2 i + 1), with what it bounds on the left.

    At its end a ring goes on along the piece that comes next clockwise. Which way a piece leaves a node is looked at a little away from
    it: tangents are in the wrong order where several crossings are one node.
    """
    starts = np.array([piece[1][0 if forwards else 1] for piece in pieces for forwards in (True, False)])
    reach = np.minimum(BEYOND, length / 2).tolist()
    ahead = np.array([_walk(walls, piece, r, not i) for piece, r in zip(pieces, reach, strict=True) for i in (0, 1)]) - nodes[starts]
    order = np.lexsort((np.arctan2(ahead[:, 1], ahead[:, 0]), starts))
    new = np.append(True, np.diff(starts[order]) != 0)
    before = np.arange(len(order)) - 1
    before[new] = np.append(np.flatnonzero(new)[1:], len(order)) - 1
    after = np.empty(len(order), np.int64)
    after[order ^ 1] = order[before]
    return components(np.arange(len(order)), after, len(order))[1]


def _walk(walls: Walls, piece: _Piece, reach: float, forwards: bool) -> np.ndarray:
    """The point [2] so far along a piece from its start, or back from its end."""
    wall, _, (start, end) = piece
    if wall < len(walls.offsets):
        normals, offsets = walls.lines
        at = wall if wall >= 0 else len(walls.offsets) + WINDOW - wall
        x, y = normals[at]
        return offsets[at] * normals[at] + (start + reach if forwards else end - reach) * np.array([y, -x])
    circle = wall - len(walls.offsets)
    if circle in walls.ovals:
        turn = reach / float(walls.radii[circle])
        return walls.around(circle, np.array([start + turn if forwards else end - turn]))[0]
    radius = walls.radii[circle]
    turn = start + reach / radius if forwards else end - reach / radius
    return walls.centers[circle] + radius * np.array([math.cos(turn), math.sin(turn)])


@dataclass(frozen=True)
class _Polygons:
    """Rings of pieces as polygons; an arc has its middle as one more corner."""

    walls: Walls
    nodes: np.ndarray
    pieces: Sequence[_Piece]

    def of(self, members: np.ndarray) -> np.ndarray:
        """Edges [e, 2, 2] of the ring of pieces `members`, 2 i forwards and 2 i + 1 backwards, in any order."""
        edges: list[tuple[np.ndarray, np.ndarray]] = []
        for member in members.tolist():
            wall, (a, b), (start, end) = self.pieces[member // 2]
            corners = [self.nodes[a], self.nodes[b]]
            if wall >= len(self.walls.offsets):
                at = wall - len(self.walls.offsets)
                turns = np.linspace(start, end, (OVAL_CORNERS if at in self.walls.ovals else ARC_CORNERS) + 2)[1:-1]
                corners[1:1] = list(self.walls.around(at, turns))
            if member % 2:
                corners.reverse()
            edges += pairwise(corners)
        return np.array(edges)


def _faces(ring: np.ndarray, codes: np.ndarray, kept: np.ndarray, polygons: _Polygons) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """Codes [f] of the faces, sorted, their outer rings as polygons, and the face [r] of each ring, OUTSIDE for one out of the window.

    A ring that runs counter-clockwise bounds a face; one that runs clockwise is a hole in that face of its code that holds it.
    """
    order = np.argsort(ring, kind="stable")
    starts = np.flatnonzero(np.append(True, np.diff(ring[order]) != 0))
    members = np.split(order, starts[1:])
    edges = [polygons.of(m) for m in members]
    outer = [r for r, m in enumerate(members) if kept[m[0]] and _signed_area(edges[r]) > 0]
    first = codes[[m[0] for m in members]]
    outer = [outer[k] for k in np.argsort(first[outer], kind="stable")]
    own = first[outer]
    face_of = np.full(len(members), OUTSIDE)
    face_of[outer] = np.arange(len(outer))
    for r, m in enumerate(members):
        if kept[m[0]] and face_of[r] == OUTSIDE:
            alike = np.flatnonzero(own == codes[m[0]])
            holding = [f for f in alike if _holds(edges[outer[f]], edges[r][:1, 0])[0]]
            # a sliver whose sides lie in the wrong order is part of what is beside it
            face_of[r] = next(iter(holding), face_of[ring[m[0] ^ 1]])
    return own, [edges[r] for r in outer], face_of


def _signed_area(edges: np.ndarray) -> float:
    """Area of a polygon of edges [e, 2, 2], positive where it runs counter-clockwise."""
    (ax, ay), (bx, by) = edges[:, 0].T, edges[:, 1].T
    return float((ax * by - bx * ay).sum()) / 2


def _distances(edges: np.ndarray, points: np.ndarray) -> np.ndarray:
    """How far points [n, 2] are from a polygon of `edges` [e, 2, 2]; 0 for those that it holds."""
    start, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    off = points[:, None] - start
    share = np.clip((off * along).sum(-1) / np.maximum((along * along).sum(-1), 1e-300), 0.0, 1.0)
    away = np.linalg.norm(off - share[..., None] * along, axis=-1).min(1)
    return np.where(_holds(edges, points), 0.0, away)


def _holds(edges: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether a polygon of edges [e, 2, 2] holds points [n, 2]."""
    (ax, ay), (bx, by) = edges[:, 0].T, edges[:, 1].T
    x, y = points[:, :1], points[:, 1:]
    crosses = (ay > y) != (by > y)
    rise = np.where(by == ay, 1.0, by - ay)
    return (crosses & (x < ax + (y - ay) * (bx - ax) / rise)).sum(1) % 2 == 1


def _longest(group: np.ndarray, length: np.ndarray) -> np.ndarray:
    """For each member [n] of a group the index of the group's longest member."""
    order = np.lexsort((length, group))
    last = np.flatnonzero(np.append(np.diff(group[order]) != 0, True))
    return order[last][group]


def _pack(sides: np.ndarray) -> np.ndarray:
    """Rows of flags as one sortable value each: a whole number where 64 bits suffice."""
    packed = np.zeros((len(sides), 8 if sides.shape[1] <= 64 else 16), np.uint8)
    bits = np.packbits(sides, axis=1)
    packed[:, : bits.shape[1]] = bits
    return packed.view(">u8").reshape(-1).astype(np.uint64) if packed.shape[1] == 8 else packed.view([("", np.void, 16)]).reshape(-1)


def _unpack(codes: np.ndarray, walls: int) -> np.ndarray:
    """The flags [n, walls] of packed rows, as numbers."""
    packed = codes.astype(">u8") if codes.dtype == np.uint64 else codes
    return np.unpackbits(packed.view(np.uint8).reshape(len(codes), codes.itemsize), axis=1, count=walls).astype(np.float32)
