"""Booleans of OpenCASCADE that are compared with the exact solids, and done in another way where they are wrong.

OpenCASCADE takes points closer than 1e-7 for one. Where faces of two shapes nearly coincide, or an edge passes closer to a corner than its
tolerance, it can lose most of a solid and still call the rest valid. Fewer edges (faces on one surface merged first) and a larger tolerance
(its "fuzzy value") help, but none of them on every shape.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import reduce
from itertools import combinations
from typing import Any, NamedTuple

from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.geometry.solid import COMBINE, CRUMB, SEGMENTS, draw_section, primitive_to_manifold
from imdim.program.nary import fold_nary
from imdim.program.outline import Outline
from imdim.program.rewrite.spread import spread_intersections
from imdim.program.tree import OPS, Op, Primitive, Program, leaves, longest

ROUGH = 1e-2  # relative volume that a shape may be off if there is no better one
CLOSE = 5e-4  # relative volume that a shape may be off, the error of `_Exact` included
INTEGRATION_ERROR = 1e-5  # relative
FINER = 2  # facets per circle of the finer exact solid, over those of the coarser one
FINENESS = (1, 2, 4, 8, 16)  # of the coarser one, over those of other exact solids: a thin bent wall needs more
SECTION_ERROR = 1e-4  # relative area that a drawn section may be off, once it is extrapolated

# shares of the largest size; what a gap may have to be closed
FUZZY = (0.0, 3e-8, 3e-7, 3e-6, 3e-5, 2e-4)
NO_GAP, HAIR_GAP = 1e-7, 3e-6  # model units, and a share of the largest size: bodies between these apart are meant to be one
SMALLEST_BODY = 1e-6  # share of the volume
MOST_BODIES = 20  # with more of them, gaps are not looked for

MOST_IN_PIECES = 4  # ways that give the right volume in too many solids, after which no way is hoped for that gives one

PLAIN_TOLERANCE = 3e-7  # share of the largest size, where all booleans at once went wrong without one

TOGETHER = 1  # ways of doing a boolean of several at once, before it is done one after another, where each takes a part of the time

MOST_SPREAD = 60  # leaves of a program whose intersections are done on its parts

PATIENCE_S = 8.0  # for a better shape than one that will do; a whole export is given 60 s


class StepError(RuntimeError):
    """OpenCASCADE is missing, or could not build or read a shape; the message is one line."""


class _Way(NamedTuple):
    """How a boolean is done: with a tolerance, a share of the largest size, and with the faces of its arguments merged before or not."""

    fuzzy: float
    merged: bool


WAYS = tuple(_Way(fuzzy, merged) for fuzzy in FUZZY for merged in (False, True))
# what comes first for all booleans of a program; which one is best is known only at the end
FIRST_WAYS = (_Way(3e-7, True), _Way(3e-6, True), _Way(0.0, False), _Way(3e-5, True), _Way(3e-8, False))


class _Exact(NamedTuple):
    """A solid of the exact booleans in two finenesses."""

    coarse: Manifold
    fine: Manifold

    def volume(self) -> float:
        return _extrapolate(self.coarse.volume(), self.fine.volume())

    def bodies(self, largest: float) -> int:
        """Bodies that count, those apart by a hair as one."""
        total = self.coarse.volume()
        found = [body for body in self.coarse.decompose() if body.volume() > SMALLEST_BODY * total]
        if not 1 < len(found) <= MOST_BODIES:
            return len(found)
        group = list(range(len(found)))
        for a, b in combinations(range(len(found)), 2):
            if group[a] != group[b] and NO_GAP < found[a].min_gap(found[b], HAIR_GAP * largest) < HAIR_GAP * largest:
                group = [group[a] if g == group[b] else g for g in group]
        return len(set(group))


def _extrapolate(coarse: float, fine: float) -> float:
    """What two finenesses tend to by Richardson: facets lack volume as the square of their size."""
    return fine + (fine - coarse) / (FINER**2 - 1)


_Combine = Callable[[list[_Exact]], _Exact]


class _Pair(NamedTuple):
    shape: Any
    exact: _Exact
    spare: int  # solids beyond the bodies of `exact`


LOST = "OpenCASCADE built a solid that is not valid once it is read back"


class _StuckError(Exception):
    """No way of doing a boolean gives the exact solid."""


def build(
    program: Program, place: Callable[[Primitive], Any], survives: Callable[[Any], bool] = lambda _: True, again: bool = True
) -> Iterator[Any]:
    """The program as a valid shape of the exact volume that `survives`, its faces merged: the first, then those in fewer solids where it is
    in more than the exact one has. Each is the one that was asked last whether it survives. Raises StepError where OpenCASCADE builds none.

    All booleans are done at once first; where the result is wrong, once more with a tolerance, and with intersections done on the parts of
    what they cut, where fewer faces meet in each. Where no such result is right, or survives, booleans are done one by one, each compared
    with its exact solid; where that gives no shape, on the parts too, and only then in other ways. Without `again`, nothing is done once
    more with a tolerance.
    """
    largest = longest(leaves(program))
    solids = [_exact_leaf(leaf) for leaf in leaves(program)]
    exact_of: Mapping[Op, _Combine] = {op: _exact(op) for op in OPS}
    exact = fold_nary(program, lambda i, _: solids[i], exact_of)
    volume, bodies = exact.volume(), exact.bodies(largest)
    spread = spread_intersections(program)
    best, failure = None, ""
    for whole, tolerance in ((program, 0.0), (spread, PLAIN_TOLERANCE))[: 1 + again]:
        plain, failure = _build_plain(whole, place, tolerance * largest)
        error = _volume_error(plain, volume)
        if error < ROUGH:
            best, failure = _finish(plain, error, volume, survives), LOST
        if best is not None:
            yield best.shape
            break
    deadline = Deadline.of_process(PATIENCE_S)
    for tried, first in enumerate(FIRST_WAYS if volume > 0 else ()):
        if best is not None and ((best.close and best.solids <= bodies) or deadline.has_passed()):
            break
        if tried == 1 and best is None and spread != program and sum(1 for _ in leaves(spread)) <= MOST_SPREAD:
            with suppress(StepError):
                yield from build(spread, place, survives, again=False)  # on the parts it was done with a tolerance above
                return
        patience = deadline if best is not None else NEVER
        shape = _build_checked(program, lambda i, leaf: _Pair(place(leaf), solids[i], 0), exact_of, first, patience)
        if shape is None or (best is not None and best.close and solids_in(shape) >= best.solids):
            continue
        found = _finish(shape, _volume_error(shape, volume), volume, survives)
        if found is None:
            failure = LOST
        else:
            best = found
            yield best.shape
    if best is None:
        raise StepError(failure)


class _Built(NamedTuple):
    """A shape that survives, whether its volume is `close` to the exact one, and its solids."""

    shape: Any
    close: bool
    solids: int


def _finish(shape: Any, error: float, volume: float, survives: Callable[[Any], bool]) -> _Built | None:
    """A shape that misses the exact `volume` by the relative `error`, with its faces merged, or as it is if only that survives; None where
    neither does."""
    close = error < CLOSE
    shape = _drop_crumbs(shape, volume)
    merged = merge_faces(shape, volume, CLOSE if close else ROUGH)
    for tried in (merged,) if merged is shape else (merged, shape):
        if survives(tried):
            return _Built(tried, close, solids_in(tried))
    return None


def _drop_crumbs(shape: Any, volume: float) -> Any:
    """The shape of a `volume` without the solids that are but what booleans leave of faces that all but touch."""
    solids = _list_solids(shape)
    whole = [solid for solid in solids if abs(shape_volume(solid, ROUGH)) > CRUMB * volume]
    if len(whole) == len(solids) or not whole:
        return shape
    if len(whole) == 1:
        return whole[0]
    builder, kept = ocp("BRep").BRep_Builder(), ocp("TopoDS").TopoDS_Compound()
    builder.MakeCompound(kept)
    for solid in whole:
        builder.Add(kept, solid)
    return kept


def _build_plain(program: Program, place: Callable[[Primitive], Any], fuzzy: float) -> tuple[Any, str]:
    """The shape, or None, and what to say of it if it is wrong."""
    try:
        shape = fold_nary(program, lambda _, leaf: place(leaf), {op: _plain(op, fuzzy) for op in OPS})
    except ocp("Standard").Standard_Failure as error:
        return None, f"OpenCASCADE failed: {str(error).splitlines()[0]}"
    except StepError as error:
        return None, str(error)
    return shape, "OpenCASCADE built an invalid or empty solid"


def _build_checked(
    program: Program, place: Callable[[int, Primitive], _Pair], exact_of: Mapping[Op, _Combine], first: _Way, deadline: Deadline
) -> Any:
    """The shape whose booleans were compared one by one and done `first` that way; None where no way does or time is up."""
    ways = (first, *(way for way in WAYS if way != first))
    combine: Mapping[Op, Callable[[list[_Pair]], _Pair]] = {
        op: _checked(op, exact_of[op], ways, longest(leaves(program)), deadline) for op in OPS
    }
    try:
        return fold_nary(program, place, combine).shape
    except _StuckError:
        return None


def _checked(op: Op, combine: _Combine, ways: tuple[_Way, ...], largest: float, deadline: Deadline) -> Callable[[list[_Pair]], _Pair]:
    def run(parts: list[_Pair]) -> _Pair:
        exact = combine([part.exact for part in parts])
        volume, bodies = exact.volume(), exact.bodies(largest)
        # what came in pieces may stay so
        allowed = bodies + sum(part.spare for part in parts)
        in_pieces: list[Any] = []
        for tried, way in enumerate(ways):
            if len(in_pieces) == MOST_IN_PIECES:
                break
            if tried == TOGETHER and not in_pieces and len(parts) > 2:
                # of several that meet in one place OpenCASCADE may lose one, whichever way
                with suppress(_StuckError):
                    return reduce(lambda done, part: run([done, part]), parts)
            if deadline.has_passed():
                raise _StuckError
            shape = _try(op, [part.shape for part in parts], way, largest)
            if not fits(shape, volume, CLOSE):
                continue
            if solids_in(shape) <= allowed:
                return _Pair(shape, exact, max(solids_in(shape) - bodies, 0))
            in_pieces.append(shape)
        if not in_pieces:
            raise _StuckError
        return _Pair(in_pieces[0], exact, solids_in(in_pieces[0]) - bodies)

    return run


def _try(op: Op, shapes: list[Any], way: _Way, largest: float) -> Any:
    """The boolean of copies, whose tolerances it raises; None where OpenCASCADE fails."""
    try:
        copies = [_unify(shape) if way.merged else copy_shape(shape) for shape in shapes]
        return _combine(op, copies, way.fuzzy * largest)
    except (ocp("Standard").Standard_Failure, StepError):
        return None


def _exact_leaf(leaf: Primitive) -> _Exact:
    coarse = SEGMENTS * (1 if leaf.outline is None else _fineness(leaf.outline))
    return _Exact(*(primitive_to_manifold(leaf, n * coarse) for n in (1, FINER)))


def _fineness(outline: Outline) -> int:
    """From which a section's area is as good as known."""

    def is_enough(n: int) -> bool:
        coarse, fine = (draw_section(outline, k * n * SEGMENTS).area() for k in (1, FINER))
        return abs(_extrapolate(coarse, fine) - outline.area) < SECTION_ERROR * outline.area

    return next((n for n in FINENESS if is_enough(n)), FINENESS[-1])


def _exact(op: Op) -> _Combine:
    """The boolean of exact solids, done once for the same ones: a program is built in several ways."""
    done: dict[tuple[int, ...], tuple[list[_Exact], _Exact]] = {}  # by their identities, which they keep while they are in here

    def run(parts: list[_Exact]) -> _Exact:
        key = tuple(map(id, parts))
        if key not in done:
            done[key] = parts, _Exact(COMBINE[op]([part.coarse for part in parts]), COMBINE[op]([part.fine for part in parts]))
        return done[key][1]

    return run


def _plain(op: Op, fuzzy: float) -> Callable[[list[Any]], Any]:
    return lambda shapes: _combine(op, shapes, fuzzy)


def _combine(op: Op, shapes: Sequence[Any], fuzzy: float = 0.0) -> Any:
    if op != "intersection":
        return boolean(_NAMES[op], shapes[:1], shapes[1:], fuzzy)
    # several tools would count as their union
    common = shapes[0]
    for shape in shapes[1:]:
        common = boolean(_NAMES[op], [common], [shape], fuzzy)
    return common


_NAMES: Mapping[Op, str] = {"union": "Fuse", "difference": "Cut", "intersection": "Common"}


def boolean(name: str, keep: Sequence[Any], tools: Sequence[Any], fuzzy: float = 0.0) -> Any:
    """OpenCASCADE's own boolean `name`, with points closer than `fuzzy` taken for one; raises StepError where it gives up."""
    operation = getattr(ocp("BRepAlgoAPI"), f"BRepAlgoAPI_{name}")()
    for shapes, setter in ((keep, operation.SetArguments), (tools, operation.SetTools)):
        listed = _shape_list()
        for shape in shapes:
            listed.Append(shape)
        setter(listed)
    operation.SetFuzzyValue(fuzzy)
    operation.SetUseOBB(True)  # fewer pairs of faces are looked at where parts lie aslant
    operation.SetRunParallel(True)  # at the end a fit waits for nothing else
    operation.Build()
    if not operation.IsDone():
        raise StepError(f"OpenCASCADE failed to {name.lower()} {len(keep) + len(tools)} shapes")
    return operation.Shape()


def _shape_list() -> Any:
    try:
        return ocp("collections").List_TopoDS_Shape()
    except ImportError:  # before OpenCASCADE 8
        return ocp("TopTools").TopTools_ListOfShape()


def merge_faces(shape: Any, volume: float, error: float = CLOSE) -> Any:
    """The shape with faces and edges on the same surface or curve merged, or as it is where OpenCASCADE spoils it by that."""
    for edges in (True, False):
        try:
            unified = _unify(shape, edges)
        except ocp("Standard").Standard_Failure:
            continue
        if fits(unified, volume, error) and solids_in(unified) <= solids_in(shape):
            return unified
    return shape


def _unify(shape: Any, edges: bool = True) -> Any:
    # of a copy: also a shape that it fails on is another one afterwards
    unify = ocp("ShapeUpgrade").ShapeUpgrade_UnifySameDomain(copy_shape(shape), edges, True, True)
    unify.Build()
    return unify.Shape()


def drop_needles(shape: Any, width: float) -> Any:
    """The shape without faces and edges narrower or shorter than a `width`, their neighbours joined: booleans of faces that all but touch
    leave needles, which hang together by tolerances that no file keeps."""
    fix = ocp("ShapeFix")
    faces = fix.ShapeFix_FixSmallFace()
    faces.Init(copy_shape(shape))
    faces.SetPrecision(width)
    faces.SetMaxTolerance(width)
    faces.Perform()
    edges = fix.ShapeFix_Wireframe(faces.FixShape())
    edges.SetPrecision(width)
    edges.SetMaxTolerance(width)
    edges.ModeDropSmallEdges = True
    edges.FixSmallEdges()
    edges.FixWireGaps()
    whole = fix.ShapeFix_Shape(edges.Shape())
    whole.Perform()
    return whole.Shape()


def copy_shape(shape: Any) -> Any:
    """A shape of its own."""
    return ocp("BRepBuilderAPI").BRepBuilderAPI_Copy(shape).Shape()


def fits(shape: Any, volume: float, error: float) -> bool:
    """Whether a shape is valid and has a volume up to the relative `error`."""
    return _volume_error(shape, volume) < error


def _volume_error(shape: Any, volume: float) -> float:
    """By how much, relative to it, a shape misses a volume; infinite for one that is not valid."""
    if shape is None or shape.IsNull() or volume <= 0 or not is_valid(shape):
        return math.inf
    return abs(shape_volume(shape, INTEGRATION_ERROR) - volume) / volume


def is_valid(shape: Any) -> bool:
    """Whether OpenCASCADE finds nothing wrong with a shape."""
    return ocp("BRepCheck").BRepCheck_Analyzer(shape).IsValid()


def shape_volume(shape: Any, error: float) -> float:
    """Volume of a TopoDS_Shape by adaptive integration over its analytic faces, to the relative `error`."""
    properties = ocp("GProp").GProp_GProps()
    ocp("BRepGProp").BRepGProp.VolumeProperties_s(shape, properties, error)
    return properties.Mass()


def solids_in(shape: Any) -> int:
    return len(_list_solids(shape))


def _list_solids(shape: Any) -> list[Any]:
    explorer, solids = ocp("TopExp").TopExp_Explorer(shape, ocp("TopAbs").TopAbs_ShapeEnum.TopAbs_SOLID), []
    while explorer.More():
        solids.append(explorer.Current())
        explorer.Next()
    return solids


def ocp(module: str) -> Any:
    """A module of the binding, by name, since it comes without types and loads in a second."""
    return importlib.import_module(f"OCP.{module}")
