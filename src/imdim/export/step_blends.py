"""Fillets and chamfers of shapes by OpenCASCADE, compared with the exact solids of the same blends.

OpenCASCADE can fail on a blend, build a shape that is not valid, or a valid one of something else; it also goes on along edges that are
tangent to one it is given. So each result is measured: it is kept if it is valid and changes the volume by what the exact solids of the
same edges do, but for corners. All features of a kind are tried together, then one after the other; of one all edges, then chain by
chain, then one by one. What still fails is made by booleans with the swept sections of the exact solids, which know no neighbours, and
what fails there too stays sharp.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations, groupby
from typing import Any, NamedTuple

import numpy as np
from manifold3d import Manifold

from imdim.deadline import Deadline
from imdim.export.placed_edges import PlacedEdges
from imdim.export.step_booleans import StepError, boolean, copy_shape, is_valid, merge_faces, ocp, shape_volume, solids_in
from imdim.geometry.blended_edge import BlendedEdge
from imdim.geometry.edge_solids import BlendSolid, blend_pieces, sweep_blends
from imdim.geometry.solid import COMBINE, to_manifold
from imdim.program.edges import Blending, EdgeNumber
from imdim.program.tree import Program, leaves, longest

AWAY = 1e-3  # of a blend's size, within which an edge of the shape lies on one of the program
ROUNDING = 3e-6  # of the largest size, which OpenCASCADE may have moved an edge by
PLACES = np.array([0.02, 0.26, 0.5, 0.74, 0.98])  # along an edge that are compared
JOINED = 1e-2  # of its size, within which ends of two edges are one
OFF = 0.05  # of the change of volume, by which it may be another one
SECTIONS = {"fillet": 1 - math.pi / 4, "chamfer": 0.5}  # of the product of both sizes, at a right angle
CORNER = 0.5  # of the section times the size: what the volume may be off at a corner
VOLUME_ERRORS = 1e-9, 1e-5  # relative: without knowing what will change, and at most
ERROR_OF_CHANGE = 1e-2  # of the change of volume, by which a volume may be known less well
NOISE = 1e-8  # of the volume, which is no change of it
PATIENCE_S = 8.0  # for all blends of a part; what is not tried by then stays sharp


class _ShapeEdge(NamedTuple):
    """An edge of a shape, the two faces that meet in it, and points [n, 3] of it."""

    edge: Any
    faces: tuple[Any, Any]
    points: np.ndarray


class _Lying(NamedTuple):
    """An edge of a shape, and the numbers of the stretches that it lies on."""

    edge: _ShapeEdge
    on: tuple[int, ...]


def blend_shape(shape: Any, program: Program, placed: PlacedEdges, build: Callable[[Program], Any]) -> tuple[Any, Blending]:
    """The valid shape of `program` with its edges blended where OpenCASCADE can do so; `build` makes shapes.

    Feature by feature; where one fails because of those before it, those that failed come first in a second trial.
    """
    deadline, stretches = Deadline.of_process(PATIENCE_S), placed.edges
    features = list(dict.fromkeys(s.feature for s in stretches))
    blended, sharp = _blend_in_order(shape, program, stretches, features, deadline)
    failed = {stretch.feature for stretch in sharp}
    again = sorted(features, key=lambda feature: feature not in failed)
    if sharp and again != features and not deadline.has_passed():
        second, still = _blend_in_order(shape, program, stretches, again, deadline)
        if len(still) < len(sharp):
            blended, sharp = second, still
    if sharp:
        blended, sharp = _sweep(blended, program, placed, sharp, build, deadline)
    return blended, Blending(_numbers(stretches), _numbers(sharp))


def _sweep(
    shape: Any,
    program: Program,
    placed: PlacedEdges,
    sharp: Sequence[BlendedEdge],
    build: Callable[[Program], Any],
    deadline: Deadline,
) -> tuple[Any, list[BlendedEdge]]:
    """The shape with those stretches of edges that are sharp blended by booleans with their swept sections, edge by edge, and those that
    stay sharp."""
    exact = _blended(to_manifold(program), blend_pieces([s for s in placed.edges if s not in sharp]))
    volume, failed = shape_volume(shape, VOLUME_ERRORS[0]), list[BlendedEdge]()
    for number in _numbers(sharp):
        group, rooms = zip(*((s, room) for s, room in placed.pairs if s in sharp and (s.feature, s.edge) == number), strict=True)
        pieces, has_time = sweep_blends(group), not deadline.has_passed()
        tried, after = shape if has_time and all(rooms) else None, exact
        for piece in pieces if tried is not None else ():
            solid = to_manifold(piece.solid)
            after = after - solid if piece.cuts else after + solid
            tried = _boolean(tried, build(piece.solid), piece.cuts)
        expected = after.volume() - exact.volume()
        if tried is None or solids_in(tried) != solids_in(shape) or not is_valid(tried):
            failed += group
            continue
        found = shape_volume(tried, _volume_error(expected, volume))
        if abs(found - volume - expected) > OFF * abs(expected) + NOISE * volume:
            failed += group
            continue
        shape, volume, exact = tried, found, after
    return merge_faces(shape, volume), failed


def _blended(solid: Manifold, pieces: Sequence[BlendSolid]) -> Manifold:
    """The exact solid with what blends fill in and cut off: its own booleans are done once for all of them."""
    fills = [to_manifold(piece.solid) for piece in pieces if not piece.cuts]
    cuts = [to_manifold(piece.solid) for piece in pieces if piece.cuts]
    filled = COMBINE["union"]([solid, *fills]) if fills else solid
    return COMBINE["difference"]([filled, *cuts]) if cuts else filled


def _volume_error(change: float, volume: float) -> float:
    """How well a volume is to be known that is compared after a change: adaptive integration takes twice as long for the last digits."""
    least, most = VOLUME_ERRORS
    return min(max(ERROR_OF_CHANGE * abs(change) / volume, least), most)


def _boolean(shape: Any, tool: Any, cuts: bool) -> Any:
    """The shape with a tool cut off or filled in; None where OpenCASCADE fails."""
    if shape is None:
        return None
    try:
        return boolean("Cut" if cuts else "Fuse", [shape], [tool])
    except (StepError, ocp("Standard").Standard_Failure):
        return None


def no_blends(stretches: Sequence[BlendedEdge]) -> Blending:
    """What is to be said of a shape in which all of these are sharp."""
    return Blending(_numbers(stretches), _numbers(stretches))


def _numbers(stretches: Sequence[BlendedEdge]) -> tuple[EdgeNumber, ...]:
    return tuple(sorted({(s.feature, s.edge) for s in stretches}))


def _blend_in_order(
    shape: Any, program: Program, stretches: Sequence[BlendedEdge], features: Sequence[int], deadline: Deadline
) -> tuple[Any, list[BlendedEdge]]:
    """The shape with features blended one after the other, and the stretches that stayed sharp.

    Those of one kind are tried together first: edges of several sizes that meet in a corner can be blended only so.
    """
    state = _State(shape, program)
    failed: list[BlendedEdge] = []
    kind_of = {s.feature: s.kind for s in stretches}
    for _, run in groupby(features, key=lambda feature: kind_of[feature]):
        together = list(run)
        groups = [[s for s in stretches if s.feature == number] for number in together]
        if len(groups) > 1 and state.blend([s for group in groups for s in group]):
            continue
        failed += [s for group in groups for s in _blend_feature(state, group, deadline)]
    return state.shape, failed


class _State:
    """A shape, and what is blended in it."""

    def __init__(self, shape: Any, program: Program) -> None:
        self.shape = shape
        self._blended: list[BlendedEdge] = []
        self._known: np.ndarray | None = None
        self._volume, self._solid = shape_volume(shape, VOLUME_ERRORS[0]), to_manifold(program)
        self._exact, self._pieces = self._solid, frozenset[BlendSolid]()
        self._slack = ROUNDING * longest(leaves(program))

    def blend(self, stretches: Sequence[BlendedEdge]) -> bool:
        """Blend stretches of features of one kind; whether that was done, else nothing is changed."""
        # of a copy, since what fails may leave other tolerances behind
        before = copy_shape(self.shape)
        chosen = _lying_on(before, stretches, self._slack, self._places())
        shape = _try(before, chosen, stretches) if chosen else None
        if shape is None or solids_in(shape) != solids_in(before) or not is_valid(shape):
            return False
        after = [*self._blended, *stretches]
        pieces = blend_pieces(after)
        exact = self._add_exactly(pieces)
        expected = exact.volume() - self._exact.volume()
        volume = shape_volume(shape, _volume_error(expected, self._volume))
        allowed = OFF * abs(expected) + _corner_volume(stretches, after) + NOISE * volume
        if abs(volume - self._volume - expected) > allowed:
            return False
        self.shape, self._blended, self._volume, self._known = shape, after, volume, None
        self._exact, self._pieces = exact, frozenset(pieces)
        return True

    def _add_exactly(self, pieces: Sequence[BlendSolid]) -> Manifold:
        """The exact solid with some pieces. It goes on from that with the last ones, but where one of these is no more, and where something
        is filled in after cuts."""
        more = [piece for piece in pieces if piece not in self._pieces]
        cuts_last = all(piece.cuts for piece in more) or not any(piece.cuts for piece in self._pieces)
        if cuts_last and self._pieces <= set(pieces):
            return _blended(self._exact, more)
        return _blended(self._solid, pieces)

    def _places(self) -> np.ndarray:
        """The points of the shape's edges, which those of its copies have too, in the same order."""
        if self._known is None:
            self._known = np.array([_places_on(edge) for edge, _ in _edges(self.shape)]).reshape(-1, len(PLACES), 3)
        return self._known

    def split(self, stretches: list[BlendedEdge]) -> list[list[BlendedEdge]]:
        """The chains of some stretches, or of one chain its pieces, which share no edge of the shape; none where there is one piece."""
        one = [pair for lying in _lying_on(self.shape, stretches, self._slack, self._places()) for pair in combinations(lying.on, 2)]
        ends = np.array([[s.end(0), s.end(1)] for s in stretches])
        gaps = np.linalg.norm(ends[:, None, :, None] - ends[None, :, None], axis=-1).min((2, 3))
        near = np.argwhere(gaps < JOINED * stretches[0].size).tolist()
        for pairs in ([*one, *near], one):
            groups = _group(stretches, pairs)
            if len(groups) > 1:
                return groups
        return []


def _corner_volume(stretches: Sequence[BlendedEdge], blended: Sequence[BlendedEdge]) -> float:
    """What the volume may be off where stretches end at blends of other features, or three blends meet: OpenCASCADE goes on round the
    others, and rounds corners, where the exact solids go straight on."""
    ends = np.array([[s.end(0), s.end(1)] for s in blended])
    total = 0.0
    for s in stretches:
        for k in (0, 1) if not s.stretch.is_closed else ():
            near = np.linalg.norm(ends - s.end(k), axis=2).min(1) < JOINED * s.size
            others = [o for o, is_near in zip(blended, near, strict=True) if is_near]
            if len(others) > 2 or any(o.feature != s.feature for o in others):
                total += CORNER * SECTIONS[s.kind] * s.sizes[0] * s.sizes[1] * max(o.size for o in others)
    return total


def _blend_feature(state: _State, stretches: list[BlendedEdge], deadline: Deadline) -> list[BlendedEdge]:
    """Blend as many stretches of one feature as can be; the others."""
    groups, failed = [stretches], list[BlendedEdge]()
    while groups:
        group = groups.pop(0)
        if deadline.has_passed():
            failed += group
        elif not state.blend(group):
            smaller = state.split(group)
            groups = [*smaller, *groups]
            failed += [] if smaller else group
    return failed


def _group(stretches: list[BlendedEdge], pairs: Sequence[Sequence[int]]) -> list[list[BlendedEdge]]:
    """The stretches that `pairs` of their numbers link, each group and all groups in their order."""
    first = list(range(len(stretches)))  # of the group of each
    for one, two in pairs:
        low, high = sorted((first[one], first[two]))
        first = [low if number == high else number for number in first]
    return [[s for s, number in zip(stretches, first, strict=True) if number == group] for group in sorted(set(first))]


def _lying_on(shape: Any, stretches: Sequence[BlendedEdge], slack: float, places: np.ndarray) -> list[_Lying]:
    """The edges of a shape that lie whole on stretches; `places` [e, p, 3] are points of its edges."""
    if not len(places):
        return []
    points = places.reshape(-1, 3)
    near = np.array([s.distances(points) <= AWAY * s.size + slack for s in stretches]).reshape(len(stretches), len(places), -1)
    owned, whole = np.any(near[:, :, 1:-1], axis=2), np.all(np.any(near, axis=0), axis=1)
    return [
        _Lying(_ShapeEdge(edge, faces, places[k]), tuple(np.flatnonzero(owned[:, k]).tolist()))
        for k, (edge, faces) in enumerate(_edges(shape))
        if whole[k]
    ]


def _edges(shape: Any) -> Iterator[tuple[Any, tuple[Any, Any]]]:
    """The edges of a shape in which two faces meet, with these."""
    kinds, topods, tool = ocp("TopAbs").TopAbs_ShapeEnum, ocp("TopoDS").TopoDS, ocp("BRep").BRep_Tool
    found = _shape_map()
    ocp("TopExp").TopExp.MapShapesAndAncestors_s(shape, kinds.TopAbs_EDGE, kinds.TopAbs_FACE, found)
    for number in range(1, found.Size() + 1):
        edge, faces = topods.Edge(found.FindKey(number)), found.FindFromIndex(number)
        if faces.Size() != 2:
            continue
        one, two = topods.Face(faces.First()), topods.Face(faces.Last())  # to go through the list takes a hundred times as long
        if not one.IsSame(two) and not tool.Degenerated_s(edge):
            yield edge, (one, two)


def _places_on(edge: Any) -> list[tuple[float, float, float]]:
    curve = ocp("BRepAdaptor").BRepAdaptor_Curve(edge)
    low, high = curve.FirstParameter(), curve.LastParameter()
    at = [curve.Value(float(t)) for t in low + (high - low) * PLACES]
    return [(p.X(), p.Y(), p.Z()) for p in at]


def _shape_map() -> Any:
    try:
        return ocp("collections").IndexedDataMap_TopoDS_Shape_List_TopoDS_Shape_TopTools_ShapeMapHasher()
    except ImportError:  # before OpenCASCADE 8
        return ocp("TopTools").TopTools_IndexedDataMapOfShapeListOfShape()


def _try(shape: Any, chosen: Sequence[_Lying], stretches: Sequence[BlendedEdge]) -> Any:
    """The shape with edges of it blended; None where OpenCASCADE fails."""
    api, kind = ocp("BRepFilletAPI"), stretches[0].kind
    maker = (api.BRepFilletAPI_MakeFillet if kind == "fillet" else api.BRepFilletAPI_MakeChamfer)(shape)
    try:
        for (edge, faces, _), on in chosen:
            stretch = stretches[on[0]]
            one, two = stretch.sizes
            if maker.Contour(edge):
                continue  # it goes on from one before, of the same size
            if one == two:
                maker.Add(one, edge)
            else:
                maker.Add(one, two, edge, min(faces, key=lambda face, s=stretch: _distance(face, s)))
        maker.Build()
        return maker.Shape() if maker.IsDone() else None
    except ocp("Standard").Standard_Failure:
        return None


def _distance(face: Any, stretch: BlendedEdge) -> float:
    """How far the surface of a face is from a point beside a stretch, on its first face."""
    at = stretch.points(3)[1] + stretch.first_along * stretch.sizes[0] / 2
    surface = ocp("BRep").BRep_Tool.Surface_s(face)
    return ocp("GeomAPI").GeomAPI_ProjectPointOnSurf(ocp("gp").gp_Pnt(*map(float, at)), surface).LowerDistance()
