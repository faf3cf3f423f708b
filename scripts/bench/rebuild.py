"""Change each named number of delivered programs by +10 % and by -10 %: ``python scripts/bench/rebuild.py RESULTS [--most 40]``

RESULTS holds results folders, of benchmark.py or of `imdim fit`. Each edit is made by the functions of `imdim edit`; a number of sides is
one more or one less, an angle is held within a full turn, and what is 0 is left as it is. An edit is

- refused, where `imdim edit` would say so in a line;
- valid, where it is not refused and `--strict` would let it pass: as many bodies, through-holes and voids as before, and no edge lost;
- right, where it is valid and the solid shows the faces that it showed: none comes up, such as the hidden end of a cutter, and none is
  gone, but for walls of polygons that have another number of sides. Where they all stay, only those move whose numbers depend on the name.

Of a part with more than `--most` names those are taken that are spread evenly over its list. The last lines name the parts with the most
edits that are not right, with one reason for each.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from manifold3d import Manifold

from imdim.export.delivered import TEXTS, Delivered, EditError
from imdim.export.edit import change_values, lost_edges, open_delivered, restate, solid_of
from imdim.export.edit_report import EditReport
from imdim.export.parameters import is_count
from imdim.geometry import kernels
from imdim.geometry.solid import exact_rotation, surface_with_owners
from imdim.program import codec
from imdim.program.edges import Face, faces_of
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Curve, Point, flatten_loop, ring_curves
from imdim.program.tree import FULL_TURN, Primitive, Program, leaves, longest

FACTORS = (1.1, 0.9)
NEAR = 1e-6  # of a primitive's size
CHORDS = 1e-3  # of the largest size, by which chords may miss what they stand for
SEEN = 1e-5  # of the surface: a smaller face is what booleans leave of faces that touch


class Edit(NamedTuple):
    """One name of a part at another value, and what was wrong with it: nothing where `kind` is "right"."""

    part: str
    name: str
    value: float
    kind: str
    reason: str = ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("--most", type=int, default=40, metavar="N", help="names of one part")
    parser.add_argument("--worst", type=int, default=20, metavar="N", help="parts in the last table")
    parser.add_argument("--all", action="store_true", help="print every edit that is not right")
    given = parser.parse_args()
    documents = sorted(path for path in given.results.glob("*/program.json") if (path.parent / TEXTS[0]).exists())
    if not documents:
        print(f"{given.results}: no folder in it has a program.json and a program.scad", file=sys.stderr)
        return 2
    done: list[Edit] = []
    print("| part | edits | refused | valid | right | seconds |\n" + "| --- " * 6 + "|")
    for path in documents:
        start = time.process_time()
        edits = list(try_edits(path, given.most))
        done += edits
        print(f"| {path.parent.name} | {shares(edits)} | {time.process_time() - start:.1f} |", flush=True)
        for edit in edits if given.all else ():
            if edit.kind != "right":
                print(f"    {edit.name} = {edit.value:g}: {edit.kind}, {edit.reason}")
    print(f"| all {len(documents)} | {shares(done)} | |")
    wrong = Counter(edit.part for edit in done if edit.kind != "right")
    for part, number in wrong.most_common(given.worst):
        first = next(edit for edit in done if edit.part == part and edit.kind != "right")
        print(f"  {part}: {number}, such as {first.name} = {first.value:g}: {first.kind}, {first.reason}")
    return 0


def shares(edits: list[Edit]) -> str:
    """How many edits there are, and how many of them were refused, valid and right."""
    n = Counter(edit.kind for edit in edits)
    valid = n["right"] + n["other faces"]
    cells = (str(n["refused"]), *(f"{k} ({k / max(len(edits), 1):.1%})" for k in (valid, n["right"])))
    return " | ".join((str(len(edits)), *cells))


def try_edits(path: Path, most: int) -> Iterator[Edit]:
    """Each edit of one results folder."""
    texts = {name: (path.parent / name).read_text(encoding="utf-8") for name in TEXTS if (path.parent / name).exists()}
    before = restate(open_delivered(codec.parse(path.read_bytes()), texts))
    solid, shown = solid_of(before), Shown.of(before.program, before.segments)
    names = [name for name, value in before.values.items() if value]
    picked = np.unique(np.linspace(0, len(names) - 1, min(most, len(names))).round().astype(int)) if names else []
    for name in (names[i] for i in picked):
        for value in _values(name, before.values[name]):
            yield Edit(path.parent.name, name, value, *judge(before, solid, shown, name, value))


def _values(name: str, old: float) -> Iterator[float]:
    if is_count(name):
        yield from (v for v in (old + 1, old - 1) if v >= 3)
        return
    for factor in FACTORS:
        value = old * factor
        yield min(value, FULL_TURN) if "angle" in name.split("_") else value


def judge(before: Delivered, solid: Manifold, shown: Shown, name: str, value: float) -> tuple[str, str]:
    """Of what kind an edit is, and why; `solid` and `shown` are those of the program before it."""
    try:
        after = change_values(before, {name: value})
        report = EditReport.of(solid, solid_of(after), lost_edges(before, after))
    except EditError as error:
        return "refused", str(error)
    if report.changes_in_kind:
        return "invalid", report.changes_in_kind
    now = Shown.of(after.program, after.segments)
    new, gone = now.without(shown), shown.without(now)
    told = [f"{len(some)} {what} ({', '.join(map(str, some[:3]))})" for what, some in (("new", new), ("gone", gone)) if some]
    return ("other faces", ", ".join(told)) if told else ("right", "")


# --- which faces of which primitives a solid shows ----------------------------------------------------------------------


class Shown(NamedTuple):
    """The primitives of a program, and for each face of them that is part of its surface, by the name that edges call it by, the middles
    [n, 3] of its triangles."""

    parts: list[Primitive]
    faces: dict[Face, np.ndarray]

    @staticmethod
    def of(program: Program, segments: int) -> Shown:
        """Raises ValueError for an outline that cannot be drawn."""
        surface, owners = surface_with_owners(program, segments)
        areas, least, parts = surface.area_faces, SEEN * surface.area, list(leaves(program))
        faces: dict[Face, np.ndarray] = {}
        for number, leaf in enumerate(parts):
            own = np.flatnonzero(owners == number)
            if len(own):
                turn, middles = exact_rotation(leaf), surface.triangles_center[own]
                names = face_names(leaf, (middles - np.array(leaf.center)) @ turn, surface.face_normals[own] @ turn, segments)
                total = np.bincount(names, areas[own], len(all_faces(leaf)))
                seen = [(i, name) for i, name in enumerate(all_faces(leaf)) if total[i] > least]
                faces |= {Face(number, name): middles[names == i] for i, name in seen}
        return Shown(parts, faces)

    def without(self, other: Shown) -> list[Face]:
        """The faces that another solid of the same primitives has and does not show, but for those where a primitive that it shows has one
        too: a polygon with more sides has more walls."""
        known, has = {face.leaf for face in other.faces}, [set(all_faces(leaf)) for leaf in other.parts]
        hidden = [(face, at) for face, at in self.faces.items() if face not in other.faces and face.name in has[face.leaf]]
        return [face for face, at in hidden if not self._is_shared(face, at, known)]

    def _is_shared(self, face: Face, at: np.ndarray, known: set[int]) -> bool:
        near = CHORDS * longest(self.parts)
        return any(np.abs(kernels.program_sdf(self.parts[i], at)).max() < near for i in sorted(known - {face.leaf}))


def all_faces(leaf: Primitive) -> list[str]:
    """The names that edges call a leaf's faces by, and ``wall[i]`` for those of ellipses, which have no edges."""
    loops = leaf.outline.loops if leaf.outline is not None else ()
    return faces_of(leaf) + [f"wall[{i}]" for i, loop in enumerate(loops) if isinstance(loop, Ellipse)]


def face_names(leaf: Primitive, middles: np.ndarray, normals: np.ndarray, segments: int) -> np.ndarray:
    """Which of `all_faces` of a leaf triangles [n] lie on, by their local middles [n, 3] and normals [n, 3], which may point either way."""
    if leaf.kind == "box":
        axis = np.abs(normals).argmax(1)
        return 2 * axis + (middles[np.arange(len(axis)), axis] < 0)
    if leaf.kind in ("cylinder", "cone"):
        end = np.abs(np.abs(middles[:, 2]) - leaf.size[-1] / 2) < NEAR * leaf.size[-1]
        return np.where(end, middles[:, 2] < 0, 2)
    if leaf.outline is None:
        return np.zeros(len(middles), int)
    planes = [name for name in faces_of(leaf) if name[0] in "+-"]
    loops = leaf.outline.loops
    ellipses = [np.array(flatten_loop(loop, segments)) for loop in loops if isinstance(loop, Ellipse)]
    lines = [np.array(flatten_curve(curve, segments)) for loop in loops if not isinstance(loop, Ellipse) for curve in ring_curves(loop)]
    flat = middles[:, :2] if leaf.kind == "extrude" else np.column_stack([np.hypot(middles[:, 0], middles[:, 1]), middles[:, 2]])
    apart = np.array([_distances(flat, corners) for corners in (*lines, *(np.vstack([e, e[:1]]) for e in ellipses))])
    nearest = np.round(apart / (NEAR * longest([leaf]))).argmin(0) + len(planes)  # of walls that coincide the first
    end = np.abs(normals[:, 2]) > 0.5 if planes else np.zeros(len(middles), bool)
    return np.where(end, middles[:, 2] < 0, nearest)


def flatten_curve(curve: Curve, segments: int) -> list[Point]:
    """The corners of the chords of a curve, with both ends."""
    x, y, u, v, bulge = curve
    return flatten_loop(((x, y, bulge), (u, v, 0.0)), segments)


def _distances(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """How far points [n, 2] lie from a line through corners [k, 2]."""
    start, way = corners[:-1], np.diff(corners, axis=0)
    along = ((points[:, None] - start) * way).sum(2) / np.maximum((way**2).sum(1), 1e-300)
    return np.linalg.norm(points[:, None] - start - np.clip(along, 0, 1)[..., None] * way, axis=2).min(1)


if __name__ == "__main__":
    sys.exit(main())
