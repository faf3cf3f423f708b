"""Text on flat faces: rows of letters of one depth, found on a mesh.

Bosses, pads, ribs, slots and fins are raised or sunk by one depth too, and are what a part is for. Letters are told from them by what
all type has in common: strokes of one width, thin for the height of a letter; outlines most of which are no circle, box or slot, and not
alike; and that they stand side by side on a line. An i's dot, a hyphen, an l or an O is as plain as a boss: a text has some of these
beside its letters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import trimesh
from manifold3d import CrossSection
from scipy.spatial import ConvexHull, QhullError

from imdim.detection.face_pieces import CarryingFace, FacePiece, find_face_pieces
from imdim.detection.facets import Facets
from imdim.geometry.components import components

LEAST_LETTERS = 3
ONE_DEPTH = 0.05  # of a piece's depth, by which that of others differs
INKED = 0.8  # of its hull's area, that a letter fills at most
CONVEX = 0.9  # of it, that a ring fills with its hole
ROUND = 0.1  # by which a ring that is no letter is longer one way than across
ALIKE = 0.02  # relative, by which areas, lengths and reaches of outlines of one letter differ
LETTERS_OF_HIGH = 0.5  # share of letters among what is high, which is no dot or stop
LETTERS_OF_ALL = 1 / 3  # likewise among all
ONE_STROKE = (0.6, 1.6)  # of the median, between which widths of strokes are
MOST_ALIKE = 0.8  # of the letters, that have strokes of one width, and thin ones
THICK = 0.5  # of the height of letters, that the largest circle in one is wide
DEEP = 0.4  # of it, that letters are deep
WIDE = 1.5  # of it, that most letters are wide at most: some are joined
BESIDE = 0.5  # of the smaller of two letters, that is beside the other, not above or below
WORDS_APART = 1.5  # of the height of letters, between two of a row
LETTERS_APART = 0.5  # of it, likewise between most of them
TALLEST = 2.2  # times as tall as another letter of a row
ON_LINE = 0.05  # of the height of letters, by which they are off their base line
ON_LINES = 1.6  # share of letters that stand on it, and of those that end at two others, together
HIGH = 0.5  # of the height of letters: what is lower is a dot or a stop, and stands on no line
MOST_OF_LEVEL = 0.6  # of the pieces of one depth on a face, that stand in rows of text if any do
AROUND = 1.3  # of the height of letters, within which a dot or a short word belongs to a row: lines are up to two apart
NO_TALLER = 1.1  # times as tall as the tallest letter of a row, that what is near it is
DIRECTIONS = 4  # in which rows are looked for, and across
STEP_DEG = 1.0  # between directions that edges are told apart by


class Lettering(NamedTuple):
    """Text on one face: its `pieces`, all by `depth` above the face, negative where they are sunk into it. The `point` [3] in its middle is
    on the face, of this `normal`; what overlaps along a row counts as one of the `letters`."""

    pieces: tuple[FacePiece, ...]
    depth: float
    point: np.ndarray
    normal: np.ndarray
    letters: int
    rows: int


class _Shape(NamedTuple):
    """The footprint of a piece: its loops of corners [k, 2], area, length of outline, how far the outline is from its middle (root mean
    square), and whether a plain thing has such an outline."""

    loops: tuple[np.ndarray, ...]
    area: float
    around: float
    reach: float
    is_plain: bool

    @property
    def corners(self) -> np.ndarray:
        return np.concatenate(self.loops)

    @property
    def stroke(self) -> float:
        """The width of a long line that has this area and length of outline."""
        return 2 * self.area / self.around


def find_lettering(mesh: trimesh.Trimesh, facets: Facets) -> Iterator[Lettering]:
    """The texts on flat faces of a `mesh`, whose facets these are."""
    for face in find_face_pieces(mesh, facets, LEAST_LETTERS):
        for level in _levels(face.pieces):
            yield from _read(face, level)


def _levels(pieces: Sequence[FacePiece]) -> Iterator[list[FacePiece]]:
    """Pieces of one depth, if enough."""
    order = sorted(pieces, key=lambda piece: piece.depth)
    while order:
        first = order[0].depth
        level = [piece for piece in order if abs(piece.depth - first) <= ONE_DEPTH * abs(first)]
        order = order[len(level) :]
        if len(level) >= LEAST_LETTERS:
            yield level


def _read(face: CarryingFace, pieces: Sequence[FacePiece]) -> Iterator[Lettering]:
    """The text that pieces of one depth make, in the direction that most of them stand in a row of."""
    shapes = [_measure(piece) for piece in pieces]
    letter_like = sum(not shape.is_plain for shape in shapes)
    if letter_like < MOST_OF_LEVEL * len(shapes) / 2 or not _has_different(shapes, LEAST_LETTERS):
        return  # pads and studs may be thousands
    depth = float(np.median([piece.depth for piece in pieces]))
    best: list[np.ndarray] = []
    for along in _directions(shapes):
        rows = list(_rows(shapes, along, abs(depth)))
        if sum(map(len, rows)) > sum(map(len, best)):
            best, way = rows, along
    if not best:
        return
    own = _with_dots(shapes, best, way)
    letters = sum(_count_letters([shapes[i] for i in row], way) for row in own)
    if letters < LEAST_LETTERS or sum(map(len, best)) < MOST_OF_LEVEL * len(shapes):
        return
    corners = np.concatenate([shapes[i].corners for i in np.concatenate(own)])
    turn = _turn(way)
    middle = turn.T @ ((corners @ turn.T).min(0) + (corners @ turn.T).max(0)) / 2
    point = face.point + face.frame[:, :2] @ middle
    yield Lettering(tuple(pieces[i] for row in own for i in row), depth, point, face.frame[:, 2], letters, len(own))


def _measure(piece: FacePiece) -> _Shape:
    outer = _even(max(piece.outlines, key=_area))
    area = sum(_area(loop) for loop in piece.outlines)
    around = sum(float(np.linalg.norm(_edges(loop), axis=1).sum()) for loop in piece.outlines)
    reach = math.sqrt(float(((outer - outer.mean(0)) ** 2).sum(1).mean()))
    return _Shape(piece.outlines, area, around, reach, _is_plain(piece))


def _area(loop: np.ndarray) -> float:
    x, y = loop.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _edges(loop: np.ndarray) -> np.ndarray:
    return np.roll(loop, -1, axis=0) - loop


def _is_plain(piece: FacePiece) -> bool:
    """Whether a boss, a pad, a slot or a standoff has such an outline: one that is all but convex, or a ring that is as wide as long."""
    outer = max(piece.outlines, key=_area)
    try:
        hull = float(ConvexHull(outer).volume)
    except QhullError:
        return True
    if sum(map(_area, piece.outlines)) > INKED * hull:
        return True
    if _area(outer) < CONVEX * hull or len(piece.outlines) != 2:
        return False
    spread = np.linalg.eigvalsh(np.cov(_even(outer).T))
    return bool(math.sqrt(spread[1] / spread[0]) < 1 + ROUND)


def _even(loop: np.ndarray, count: int = 100) -> np.ndarray:
    """Points [count, 2] evenly along a loop."""
    closed = np.concatenate([loop, loop[:1]])
    at = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1)))
    places = np.linspace(0, at[-1], count, endpoint=False)
    return np.column_stack([np.interp(places, at, closed[:, k]) for k in (0, 1)])


def _directions(shapes: Sequence[_Shape]) -> Iterator[np.ndarray]:
    """Unit vectors [2] that rows may run along: those of the most and longest edges, and across them."""
    edges = np.concatenate([_edges(loop) for shape in shapes for loop in shape.loops])
    lengths = np.linalg.norm(edges, axis=1)
    bins = round(90 / STEP_DEG)
    place = np.round(np.degrees(np.arctan2(edges[:, 1], edges[:, 0])) % 90 / STEP_DEG).astype(int) % bins
    total = np.bincount(place, lengths**2, bins)
    most = [k for k in np.argsort(-total, kind="stable")[:DIRECTIONS] if total[k] > 0]
    longest = [int(np.flatnonzero(place == k)[lengths[place == k].argmax()]) for k in most]
    for x, y in (edges[i] / lengths[i] for i in longest):
        yield np.array([x, y])
        yield np.array([-y, x])


def _turn(along: np.ndarray) -> np.ndarray:
    """The matrix [2, 2] that takes points to their places along a row and across it."""
    return np.array([along, [-along[1], along[0]]])


def _boxes(shapes: Sequence[_Shape], along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Low and high corners [k, 2] of pieces, along rows and across."""
    local = [shape.corners @ _turn(along).T for shape in shapes]
    return np.array([c.min(0) for c in local]), np.array([c.max(0) for c in local])


def _rows(shapes: Sequence[_Shape], along: np.ndarray, depth: float) -> Iterator[np.ndarray]:
    """The indices of pieces that are a row of letters along a direction."""
    low, high = _boxes(shapes, along)
    size = high - low
    i, j = np.triu_indices(len(shapes), 1)
    shared = np.minimum(high[i], high[j]) - np.maximum(low[i], low[j])
    least = np.minimum(size[i], size[j])
    tall = np.maximum(size[i, 1], size[j, 1])
    plain = np.array([shape.is_plain for shape in shapes])
    fits = (tall <= TALLEST * least[:, 1]) | plain[i] | plain[j]
    beside = (shared[:, 1] >= BESIDE * least[:, 1]) & (shared[:, 0] <= BESIDE * least[:, 0]) & (shared[:, 0] >= -WORDS_APART * tall)
    _, row = components(i[beside & fits], j[beside & fits], len(shapes))
    for number in np.unique(row):
        own = np.flatnonzero(row == number)
        if _is_text([shapes[k] for k in own.tolist()], low[own], high[own], depth):
            yield own


def _is_text(shapes: Sequence[_Shape], low: np.ndarray, high: np.ndarray, depth: float) -> bool:
    """Whether pieces [k] that stand side by side between corners [k, 2] are letters."""
    letter = np.array([not shape.is_plain for shape in shapes])
    letters = [shape for shape in shapes if not shape.is_plain]
    if letter.mean() <= LETTERS_OF_ALL or not _has_different(shapes, LEAST_LETTERS) or not _has_different(letters, 2):
        return False
    height = float(np.median((high - low)[letter, 1]))
    is_high = letter | (high[:, 1] - low[:, 1] > HIGH * height)
    if len(letters) <= LETTERS_OF_HIGH * np.count_nonzero(is_high):
        return False
    order = np.argsort(low[:, 0])
    gaps = low[order[1:], 0] - np.maximum.accumulate(high[order, 0])[:-1]
    return bool(
        depth < DEEP * height
        and np.median(gaps) < LETTERS_APART * height
        and np.median((high - low)[letter, 0]) < WIDE * height
        and _are_strokes(letters, height)
        and not _are_stacked(low[letter, 0], high[letter, 0])
        and _are_on_lines(low[is_high, 1], high[is_high, 1], height)
    )


def _are_strokes(letters: Sequence[_Shape], height: float) -> bool:
    """Whether letters of a height are strokes of one width, and thin."""
    strokes = np.array([shape.stroke for shape in letters])
    width = float(np.median(strokes))
    one_width = (strokes > ONE_STROKE[0] * width) & (strokes < ONE_STROKE[1] * width)
    thin = [CrossSection(list(shape.loops)).offset(-THICK / 2 * height).is_empty() for shape in letters]
    return bool(min(np.mean(one_width), np.mean(thin)) >= MOST_ALIKE)


def _are_stacked(start: np.ndarray, end: np.ndarray) -> bool:
    """Whether two of what reaches from `start` to `end` [k] along a row lie above each other."""
    i, j = np.triu_indices(len(start), 1)
    return bool(
        (np.minimum(end[i], end[j]) - np.maximum(start[i], start[j]) > BESIDE * np.minimum(end[i] - start[i], end[j] - start[j])).any()
    )


def _are_on_lines(low: np.ndarray, high: np.ndarray, height: float) -> bool:
    """Whether letters between `low` and `high` [k] stand on one line, or hang from it, and end at two others at most, as small letters and
    capitals do. Of three letters each has to."""
    least = 2.0 if len(low) <= LEAST_LETTERS else ON_LINES
    for line, ends in ((low, high), (high, low)):
        on_line = _densest(line, 2 * ON_LINE * height)
        first = _densest(ends, 2 * ON_LINE * height)
        second = _densest(ends[~first], 2 * ON_LINE * height)
        if on_line.mean() + (np.count_nonzero(first) + np.count_nonzero(second)) / len(ends) >= least:
            return True
    return False


def _densest(values: np.ndarray, width: float) -> np.ndarray:
    """Which of the values [k] lie in the interval of a width that has the most of them."""
    if not len(values):
        return np.zeros(0, bool)
    inside = (values >= values[:, None]) & (values <= values[:, None] + width)
    return inside[inside.sum(1).argmax()]


def _has_different(shapes: Sequence[_Shape], least: int) -> bool:
    """Whether so many of the shapes at `least` differ from each other."""
    known: list[np.ndarray] = []
    for shape in shapes:
        one = np.array([shape.area, shape.around, shape.reach])
        if not any((np.abs(one - other) < ALIKE * one).all() for other in known):
            known.append(one)
        if len(known) >= least:
            return True
    return False


def _with_dots(shapes: Sequence[_Shape], rows: Sequence[np.ndarray], along: np.ndarray) -> list[np.ndarray]:
    """The rows with dots, accents, stops and short words beside them, which are no rows by themselves: what is no higher than a letter,
    near a row, and of its stroke, but no long bar."""
    low, high = _boxes(shapes, along)
    free = set(range(len(shapes))) - set(np.concatenate(rows).tolist())
    out: list[np.ndarray] = []
    for row in rows:
        height = float(np.median((high - low)[row, 1]))
        width = float(np.median([shapes[i].stroke for i in row]))
        start, end = low[row].min(0) - AROUND * height, high[row].max(0) + AROUND * height
        near = [
            i
            for i in sorted(free)
            if high[i, 1] - low[i, 1] < NO_TALLER * (high - low)[row, 1].max()
            and (high[i, 0] - low[i, 0] < TALLEST * height or not shapes[i].is_plain)
            and (low[i] >= start - height).all()
            and (high[i] <= end + height).all()
            and ((high[i] >= start) & (low[i] <= end)).all()
            and shapes[i].stroke < ONE_STROKE[1] * width
        ]
        free -= set(near)
        out.append(np.array([*row, *near]))
    return out


def _count_letters(shapes: Sequence[_Shape], along: np.ndarray) -> int:
    """How many of the pieces of a row stand beside each other: the dot of an i stands above it."""
    low, high = _boxes(shapes, along)
    i, j = np.triu_indices(len(shapes), 1)
    shared = np.minimum(high[i], high[j])[:, 0] - np.maximum(low[i], low[j])[:, 0]
    over = shared > BESIDE * np.minimum(high[i] - low[i], high[j] - low[j])[:, 0]
    return components(i[over], j[over], len(shapes))[0]
