"""Take the threads off a mesh: what is left is a plain cylinder, as wide as a bolt's crests or as a nut's.

No volume is computed. The triangles of a thread go, and its two rims, which are moved to where the cylinder meets the faces beside them,
are joined by a band. Where the thread runs out on a chamfer or a countersink, this belongs to the band, which is bent where it meets the
cylinder.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import trimesh
from manifold3d import Error, Manifold

from imdim.detection.facets import Facets
from imdim.detection.threads import ACROSS, Thread, measure_to_axis, measure_turns
from imdim.geometry.components import components
from imdim.geometry.solid import solid_of, to_trimesh
from imdim.geometry.surface import unit
from imdim.target.bodies import compact, edge_table, face_normals

NEAR = 0.02  # of the depth, within which a corner is on the crest or on a chamfer
SECTORS = 16  # about the axis, half of which a chamfer has corners in
ROUNDS = 3  # of fitting a cone
STEPS = 8
REACHED = 1e-5  # of the depth, within which a corner has reached where it goes
ALONGSIDE = 0.9  # cosine between a face and the way away from the axis: it goes on where the thread ends
ONE_FACE = math.cos(math.radians(25))  # between normals of one face beside a thread
WIDEST = 1.5  # times the median angle between corners of a rim, that any two lie apart
ROOM = 1.05  # times the volume between two cylinders: no thread is larger


class PlainMesh(NamedTuple):
    """A mesh without `threads`; those `kept` could not be taken off."""

    mesh: trimesh.Trimesh
    threads: tuple[Thread, ...]
    kept: tuple[Thread, ...] = ()


class _RunOut(NamedTuple):
    """Where a thread runs out: the cylinder ends at `corner` along the axis and grows by `slope` beyond."""

    corner: float
    slope: float


class _Envelope(NamedTuple):
    """What a thread is cut from: a cylinder of `radius` with a cone at either end, or none."""

    radius: float
    low: _RunOut | None
    high: _RunOut | None

    def at(self, along: np.ndarray) -> np.ndarray:
        """The radii [n] at places along the axis."""
        out = np.full(len(along), self.radius)
        for cone, way in ((self.low, -1), (self.high, 1)):
            if cone is not None:
                out += np.where(way * (along - cone.corner) > 0, cone.slope * (along - cone.corner), 0.0)
        return out


def take_off_threads(mesh: trimesh.Trimesh, facets: Facets, threads: Sequence[Thread]) -> PlainMesh:
    """The mesh, whose facets these are, without those of its `threads` whose band gives a solid."""
    vertices, faces, volume = np.array(mesh.vertices, float), np.asarray(mesh.faces), float(mesh.volume)
    owner = np.full(len(facets.areas), -1)
    for k, thread in enumerate(threads):
        owner[thread.facets] = k
    owner = owner[facets.facet_of]
    done: list[int] = []
    for k, thread in enumerate(threads):
        solid = None
        for beyond in (True, False):
            found = _band(vertices, faces, owner == k, thread, beyond)
            solid = None if found is None else solid_of(*compact(found.vertices, found.faces))
            if found is not None and solid is not None and _is_plain(solid, volume, thread):
                volume, vertices, faces = solid.volume(), found.vertices, found.faces
                owner = np.where(found.parents < 0, -1, owner[found.parents])
                done.append(k)
                break
    if not done:
        return PlainMesh(mesh, (), tuple(threads))
    plain = to_trimesh(solid_of(*compact(vertices, faces)))
    return PlainMesh(plain, tuple(threads[k] for k in done), tuple(t for k, t in enumerate(threads) if k not in done))


def _is_plain(solid: Manifold, before: float, thread: Thread) -> bool:
    """Whether a solid is one, and has grown by no more than what lies between the cylinders of a thread."""
    most = math.pi / 4 * (thread.major**2 - thread.minor**2) * (thread.high - thread.low + 2 * thread.pitch)
    return solid.status() == Error.NoError and 0 < solid.volume() - before < ROOM * most


class _Part(NamedTuple):
    """Some triangles of a mesh: corners [v, 3], triangles [f, 3], and of which triangle each was part, -1 for none."""

    vertices: np.ndarray
    faces: np.ndarray
    parents: np.ndarray


def _band(vertices: np.ndarray, faces: np.ndarray, own: np.ndarray, thread: Thread, beyond: bool) -> _Part | None:
    """The mesh with a band in place of its `own` triangles [f], which show a thread, and of the cones that this runs out on; of the
    cylinder that goes on `beyond` it too, if asked. None where they have no two rims that go around once."""
    envelope = _envelope(vertices[np.unique(faces[own])], thread)
    facing = face_normals(vertices, faces)[0]
    own = _with_ends(vertices, faces, facing, own, envelope, thread, beyond)
    placed = _place_rims(vertices, faces, facing, own, envelope, thread)
    rims = None if placed is None else _rims(placed, faces[own], thread)
    if placed is None or rims is None:
        return None
    kept = np.flatnonzero(~own)
    rest, evened = _Part(placed, faces[kept], kept), list[_BandEdge]()
    widest = WIDEST * min(float(np.median(np.diff(rim.turns))) for rim in rims)
    for rim in rims:
        rest, even = _even_out(rest, facing, rim, widest, thread)
        evened.append(even)
    low, high = evened
    points, chain = rest.vertices, [low]
    for cone, rim in ((envelope.low, low), (envelope.high, high)):
        if cone is not None and low.height < cone.corner < high.height:
            ring = _ring(points, rim, cone.corner, envelope.radius, thread)
            chain.append(_BandEdge(np.arange(len(points), len(points) + len(ring)), rim.turns, cone.corner))
            points = np.concatenate([points, ring])
    band = np.concatenate([_strip(one, two) for one, two in pairwise([*chain, high])])
    band = band[:, ::-1] if thread.internal else band
    return _Part(points, np.concatenate([rest.faces, band]), np.append(rest.parents, np.full(len(band), -1)))


def _even_out(rest: _Part, facing: np.ndarray, rim: _BandEdge, widest: float, thread: Thread) -> tuple[_Part, _BandEdge]:
    """The triangles around a thread, of normals `facing` [f, 3], and their rim, with more corners where it has none for more than an angle
    `widest` and the face beside it lies across the axis: a strip that is much wider than the others shows no cylinder."""
    vertices, faces, parents = list(rest.vertices), rest.faces.tolist(), rest.parents.tolist()
    at = {side: t for t, triangle in enumerate(faces) for side in _sides(triangle)}
    numbers, turns = [int(rim.numbers[0])], [float(rim.turns[0])]
    ends = zip(np.roll(rim.numbers, -1).tolist(), np.append(rim.turns[1:], rim.turns[0] + 2 * math.pi).tolist(), strict=True)
    for after, turn in ends:
        before, start = numbers[-1], turns[-1]
        pieces = math.ceil((turn - start) / widest)
        key = (before, after) if (before, after) in at else (after, before)
        beside = at[key]
        if pieces > 1 and abs(float(facing[parents[beside]] @ thread.axis)) > ACROSS:
            corners = _between(rest.vertices[before], rest.vertices[after], pieces, thread)
            added = list(range(len(vertices), len(vertices) + len(corners)))
            vertices += list(corners)
            numbers += added
            turns += [start + (turn - start) * k / pieces for k in range(1, pieces)]
            (opposite,) = set(faces[beside]) - {before, after}
            walk = [before, *added, after] if key[0] == before else [after, *added[::-1], before]
            fan = [[a, b, opposite] for a, b in pairwise(walk)]
            faces[beside] = fan[0]
            faces += fan[1:]
            parents += [parents[beside]] * (len(fan) - 1)
            places = [beside, *range(len(faces) - len(fan) + 1, len(faces))]
            at |= {side: place for place, piece in zip(places, fan, strict=True) for side in _sides(piece)}
        numbers.append(after)
        turns.append(turn)
    part = _Part(np.array(vertices), np.array(faces).reshape(-1, 3), np.array(parents))
    return part, _BandEdge(np.array(numbers[:-1]), np.array(turns[:-1]), rim.height)


def _sides(triangle: Sequence[int]) -> list[tuple[int, int]]:
    x, y, z = triangle
    return [(x, y), (y, z), (z, x)]


def _between(one: np.ndarray, two: np.ndarray, pieces: int, thread: Thread) -> np.ndarray:
    """Corners [pieces - 1, 3] on the arc about the axis between two."""
    share = np.arange(1, pieces)[:, None] / pieces
    arms = [p - thread.point - ((p - thread.point) @ thread.axis) * thread.axis for p in (one, two)]
    radii = [float(np.linalg.norm(arm)) for arm in arms]
    angle = math.acos(min(float(arms[0] @ arms[1]) / (radii[0] * radii[1]), 1.0))
    ahead = (np.sin((1 - share) * angle) * arms[0] / radii[0] + np.sin(share * angle) * arms[1] / radii[1]) / math.sin(angle)
    along = (1 - share) * ((one - thread.point) @ thread.axis) + share * ((two - thread.point) @ thread.axis)
    return thread.point + along * thread.axis + ((1 - share) * radii[0] + share * radii[1]) * ahead


def _envelope(points: np.ndarray, thread: Thread) -> _Envelope:
    """The cylinder through the crests of a thread with these corners [n, 3], and the cones that it runs out on: its convex hull, seen from
    the side. What is lower at an end is a cone where corners all around lie on it."""
    away, along = measure_to_axis(points, thread.point, thread.axis)
    way, crest, near = (-1.0 if thread.internal else 1.0), thread.crest / 2, NEAR * (thread.major - thread.minor) / 2
    depth = np.maximum(crest - way * (away - crest) - crest, 0.0)  # below the crest
    cones: list[_RunOut | None] = []
    for end in (-1, 1):
        x, y = _upper_hull(end * along, -depth)
        low = np.flatnonzero(y < -near)
        low = low[x[low] > x[y.argmax()]]
        cones.append(None)
        if not len(low):
            continue
        start = float(x[y >= -near].max())
        on = (end * along >= start) & (np.abs(-depth - np.interp(end * along, x, y)) < near) & (depth > near)
        if np.count_nonzero(on) >= SECTORS / 2 and _goes_around(points[on], thread):
            fall, at_crest = _fit_outer(end * along[on], away[on] - crest)
            cones[-1] = _RunOut(end * -at_crest / fall, end * fall)
    return _Envelope(crest, cones[0], cones[1])


def _fit_outer(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Slope and offset of the line that corners lie on or, being on chords of the circles about the axis, a little below."""
    slope, offset = np.polyfit(x, y, 1)
    for _ in range(ROUNDS):
        off = y - (slope * x + offset)
        upper = off >= np.median(off)
        if np.count_nonzero(upper) < SECTORS / 2:
            break
        x, y = x[upper], y[upper]
        slope, offset = np.polyfit(x, y, 1)
    return float(slope), float(offset)


def _upper_hull(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The corners of the convex hull of points that one looking down sees (Andrew 1979)."""
    chain: list[tuple[float, float]] = []
    for p in sorted(zip(x.tolist(), y.tolist(), strict=True)):
        while len(chain) > 1 and _turns_left(chain[-2], chain[-1], p):
            chain.pop()
        chain.append(p)
    found = np.array(chain)
    return found[:, 0], found[:, 1]


def _turns_left(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) >= (b[1] - a[1]) * (c[0] - a[0])


def _goes_around(points: np.ndarray, thread: Thread) -> bool:
    """Whether corners [n, 3] lie on half of the sides of an axis at least."""
    return len(np.unique(np.floor(measure_turns(points, thread.point, thread.axis) / (2 * math.pi) * SECTORS))) >= SECTORS / 2


def _with_ends(
    vertices: np.ndarray,
    faces: np.ndarray,
    facing: np.ndarray,
    own: np.ndarray,
    envelope: _Envelope,
    thread: Thread,
    beyond: bool,
) -> np.ndarray:
    """Triangles [f] of a thread, and those of its envelope that hang together with them."""
    away, along = measure_to_axis(vertices, thread.point, thread.axis)
    near = NEAR * (thread.major - thread.minor) / 2
    on = (np.abs(away - envelope.at(along)) < near)[faces].all(1)
    middle = vertices[faces].mean(1)
    height = measure_to_axis(middle, thread.point, thread.axis)[1]
    slope = (envelope.at(height + near) - envelope.at(height - near)) / (2 * near)
    radial = middle - thread.point - np.outer(height, thread.axis)
    outward = unit(unit(radial) - slope[:, None] * thread.axis) * (-1 if thread.internal else 1)
    along_it = (outward * facing).sum(1) > ONE_FACE
    on &= along_it & (beyond | (np.abs(slope) > 0))
    edge = edge_table(faces)[3].reshape(3, -1)
    order = np.argsort(edge.reshape(-1), kind="stable")
    one, two = order[:-1] % len(faces), order[1:] % len(faces)
    joined = (edge.reshape(-1)[order[1:]] == edge.reshape(-1)[order[:-1]]) & (on | own)[one] & (on | own)[two]
    label = components(one[joined], two[joined], len(faces))[1]
    return (on | own) & np.isin(label, label[own])


def _place_rims(
    vertices: np.ndarray, faces: np.ndarray, facing: np.ndarray, own: np.ndarray, envelope: _Envelope, thread: Thread
) -> np.ndarray | None:
    """The corners [v, 3], those that a thread's `own` triangles [f] share with other faces on the envelope, where that meets these; None
    where one finds no place."""
    near = NEAR * (thread.major - thread.minor) / 2
    out = vertices.copy()
    for vertex, beside in _faces_beside(faces, own, facing).items():
        away, along = measure_to_axis(vertices[vertex][None], thread.point, thread.axis)
        step = abs(float(envelope.at(along)[0] - away[0]))
        if step < near:
            continue  # it is there, on a chord perhaps
        placed = _place(vertices[vertex], beside, envelope, thread)
        if placed is None or np.linalg.norm(placed - vertices[vertex]) > 2 * step + near:
            return None
        out[vertex] = placed
    return out


def _faces_beside(faces: np.ndarray, own: np.ndarray, facing: np.ndarray) -> dict[int, list[np.ndarray]]:
    """The normals of the faces that have a corner of `own` triangles [f] and are none of them, by corner."""
    found: dict[int, list[np.ndarray]] = {}
    for triangle, corner in np.argwhere(np.isin(faces, faces[own]) & ~own[:, None]):
        normals = found.setdefault(int(faces[triangle, corner]), [])
        if not any(facing[triangle] @ n > ONE_FACE for n in normals):
            normals.append(facing[triangle])
    return found


def _place(point: np.ndarray, beside: Sequence[np.ndarray], envelope: _Envelope, thread: Thread) -> np.ndarray | None:
    """A corner on the envelope, by Newton's steps in the planes of normals `beside` through it."""
    out = point.copy()
    for _ in range(STEPS):
        away, along = measure_to_axis(out[None], thread.point, thread.axis)
        off = float(envelope.at(along)[0] - away[0])
        if abs(off) < REACHED * thread.major:
            return out
        ahead = (out - thread.point - along[0] * thread.axis) / away[0]
        planes = [n for n in beside if abs(float(n @ ahead)) < ALONGSIDE]
        steps = np.array([off, *(float(n @ (point - out)) for n in planes)])
        out = out + np.linalg.lstsq(np.stack([ahead, *planes]), steps, rcond=None)[0]
    return None


class _BandEdge(NamedTuple):
    """Corners [n] around an axis by rising angle, their angles [n], and how high along it they lie."""

    numbers: np.ndarray
    turns: np.ndarray
    height: float


def _rims(vertices: np.ndarray, own: np.ndarray, thread: Thread) -> tuple[_BandEdge, _BandEdge] | None:
    """The lower and the upper rim of triangles [t, 3], None where they have others, or one turns back."""
    sides = np.concatenate([own[:, [0, 1]], own[:, [1, 2]], own[:, [2, 0]]])
    there = {(int(a), int(b)) for a, b in sides}
    ahead = {a: b for a, b in there if (b, a) not in there}
    rims: list[_BandEdge] = []
    while ahead and len(rims) < 2:
        loop = [next(iter(ahead))]
        while (after := ahead.pop(loop[-1], None)) is not None and after != loop[0]:
            loop.append(after)
        numbers = np.array(loop)
        turns = np.unwrap(measure_turns(vertices[numbers], thread.point, thread.axis))
        if turns[-1] < turns[0]:
            numbers, turns = numbers[::-1], turns[::-1]
        first = int((turns % (2 * math.pi)).argmin())
        numbers, turns = np.roll(numbers, -first), np.roll(turns, -first) % (2 * math.pi)
        if len(numbers) < 3 or (np.diff(turns) <= 0).any():
            return None
        rims.append(_BandEdge(numbers, turns, float(measure_to_axis(vertices[numbers], thread.point, thread.axis)[1].mean())))
    if ahead or len(rims) != 2:
        return None
    low, high = sorted(rims, key=lambda rim: rim.height)
    return low, high


def _ring(vertices: np.ndarray, rim: _BandEdge, height: float, radius: float, thread: Thread) -> np.ndarray:
    """Points [n, 3] on a cylinder that lie at one height, at the angles of a rim."""
    arm = vertices[rim.numbers] - thread.point
    arm -= np.outer(arm @ thread.axis, thread.axis)
    return thread.point + height * thread.axis + radius * unit(arm)


def _strip(low: _BandEdge, high: _BandEdge) -> np.ndarray:
    """Triangles [t, 3] between two rims, seen from outside: of the next sides the one whose middle comes first, so that none leans much."""
    lower, upper = (np.append(rim.turns, rim.turns[0] + 2 * math.pi) for rim in (low, high))
    i = j = 0
    out: list[tuple[int, int, int]] = []
    while i < len(low.numbers) or j < len(high.numbers):
        a, b = (int(rim.numbers[k % len(rim.numbers)]) for rim, k in ((low, i), (high, j)))
        if j == len(high.numbers) or (i < len(low.numbers) and lower[i] + lower[i + 1] <= upper[j] + upper[j + 1]):
            i += 1
            out.append((a, int(low.numbers[i % len(low.numbers)]), b))
        else:
            j += 1
            out.append((a, int(high.numbers[j % len(high.numbers)]), b))
    return np.array(out)
