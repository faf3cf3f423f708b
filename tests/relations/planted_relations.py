"""The true relations of a program with exact numbers, by brute force over its features: what discovery is measured against.

Written against the definitions of the constraint kinds alone, with plain functions of the leaves' numbers and differences for derivatives.
What of a program shows is told by exact points of its surface: the faces that they lie on.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.program.constraints import Constraint, Ref
from imdim.program.tree import SIZE_NAMES, Primitive, Program, leaves

EXACT = 1e-5  # the generator's numbers are single precision, its parts have the diagonal 1
LEAST_POINTS = 8  # on a face that shows
AXES = "xyz"
AXES_OF = {"box": "xyz", "cylinder": "z", "sphere": ""}
FACES = {"box": ("+x", "-x", "+y", "-y", "+z", "-z"), "cylinder": ("+z", "-z", "r"), "sphere": ("r",)}


class Leaf:
    """A leaf's numbers as arrays; `moved` gives it after a step [9]: sizes, centre, rotation vector in the world."""

    def __init__(self, kind: str, size: np.ndarray, center: np.ndarray, frame: np.ndarray) -> None:
        self.kind, self.size, self.center, self.frame = kind, size, center, frame

    @classmethod
    def of(cls, p: Primitive) -> Leaf:
        size = np.array([*p.size, *[0.0] * (3 - len(p.size))])
        return cls(p.kind, size, np.array(p.center), matrix_from_euler(p.rotation))

    def moved(self, step: np.ndarray) -> Leaf:
        angle = float(np.linalg.norm(step[6:]))
        turn = np.eye(3)
        if angle:
            x, y, z = step[6:] / angle
            k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            turn = np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k
        return Leaf(self.kind, self.size + step[:3], self.center + step[3:6], turn @ self.frame)

    def half(self, axis: str) -> float:
        return float(self.size[AXES.index(axis)] if self.kind == "box" else self.size[1]) / 2

    def length(self, name: str) -> float:
        return float(self.size[SIZE_NAMES[self.kind].index(name)])


Leaves = Sequence[Leaf]


def direction(parts: Leaves, ref: Ref) -> np.ndarray:
    column = AXES.index(ref.feature[-1])
    return np.eye(3)[column] if ref.leaf < 0 else parts[ref.leaf].frame[:, column]


def place(parts: Leaves, ref: Ref) -> np.ndarray:
    leaf = parts[ref.leaf]
    if not ref.feature or ref.feature[0] not in "+-":
        return leaf.center
    side = 1 if ref.feature[0] == "+" else -1
    return leaf.center + side * leaf.half(ref.feature[1]) * leaf.frame[:, AXES.index(ref.feature[1])]


def gap(c: Constraint, parts: Leaves) -> np.ndarray:
    """What vanishes exactly where a pairwise constraint (or a pattern) holds; lengths and sines."""
    return np.atleast_1d(GAPS[c.kind](c, parts))


def _circular(c: Constraint, parts: Leaves) -> np.ndarray:
    axis = direction(parts, c.about)
    members = [ref.leaf for ref in c.of]
    centers = np.array([parts[m].center for m in members])
    hub = centers.mean(0) if c.about.leaf in members else parts[c.about.leaf].center
    flat = centers - hub - np.outer((centers - hub) @ axis, axis)
    out = []
    angle = 2 * math.pi / len(members)
    for i in range(len(members)):
        turned = math.cos(angle) * flat[i] + math.sin(angle) * np.cross(axis, flat[i])
        out.append(turned - flat[(i + 1) % len(members)])
    for a, b in itertools.pairwise(c.of):
        if a.feature and len(AXES_OF[parts[a.leaf].kind]) == 3:
            before = direction(parts, a)
            turned = math.cos(angle) * before + math.sin(angle) * np.cross(axis, before)
            out.append([float(np.cross(turned, direction(parts, b)) @ axis)])
    return np.concatenate(out)


def _linear(c: Constraint, parts: Leaves) -> np.ndarray:
    centers = np.array([parts[ref.leaf].center for ref in c.of])
    bend = centers[:-2] - 2 * centers[1:-1] + centers[2:]
    first = parts[c.of[0].leaf]
    return (bend @ (first.frame[:, :2] if first.kind == "cylinder" else np.eye(3))).ravel()


GAPS: dict[str, Callable[[Constraint, Leaves], np.ndarray | float]] = {
    "equal": lambda c, p: p[c.of[0].leaf].length(c.of[0].feature) - p[c.of[1].leaf].length(c.of[1].feature),
    "value": lambda c, p: p[c.of[0].leaf].length(c.of[0].feature) - c.value,
    "parallel": lambda c, p: np.cross(direction(p, c.of[0]), direction(p, c.of[1])),
    "perpendicular": lambda c, p: float(direction(p, c.of[0]) @ direction(p, c.of[1])),
    "coplanar": lambda c, p: float((place(p, c.of[1]) - place(p, c.of[0])) @ direction(p, c.of[0])),
    "aligned": lambda c, p: float((place(p, c.of[1]) - place(p, c.of[0])) @ direction(p, c.about)),
    "coaxial": lambda c, p: np.cross(place(p, Ref(c.of[1].leaf)) - place(p, Ref(c.of[0].leaf)), direction(p, c.of[0])),
    "concentric": lambda c, p: place(p, c.of[1]) - place(p, c.of[0]),
    "symmetric": lambda c, p: float((place(p, c.of[0]) + place(p, c.of[1]) - 2 * place(p, c.of[2])) @ direction(p, c.about)),
    "linear": _linear,
    "circular": _circular,
}


class Truth:
    """What holds for a program, as far as `exact` points [n, 3] of its surface show it."""

    def __init__(self, program: Program, exact: np.ndarray) -> None:
        self.parts = [Leaf.of(p) for p in leaves(program)]
        self.shown = shown_faces(self.parts, exact)
        self.relations = list(self._relations())
        self.rows = self._jacobian(self.relations)

    def pairs(self, constraints: Sequence[Constraint]) -> list[Constraint]:
        """Constraints of many features as pairs with the first of them."""
        out: list[Constraint] = []
        for c in constraints:
            if c.kind in ("parallel", "equal", "coaxial", "concentric"):
                out += [Constraint(c.kind, (c.of[0], other)) for other in c.of[1:]]
            else:
                out.append(Constraint(c.kind, c.of, c.about, c.value))
        return out

    def holds(self, c: Constraint) -> bool:
        return bool(np.abs(gap(c, self.parts)).max() < EXACT)

    def spanned(self, found: Sequence[Constraint]) -> tuple[int, int]:
        """How much of the rank of the true relations those found span, and that rank."""
        rank = _rank(self.rows)
        rows = self._jacobian(found)
        return _rank(rows) + rank - _rank(np.vstack([rows, self.rows])), rank

    def missed(self, found: Sequence[Constraint]) -> list[str]:
        """True relations that say what those found do not, each beyond those before it."""
        rows, out = self._jacobian(found), []
        rank = _rank(rows)
        for relation in self.relations:
            more = np.vstack([rows, self._jacobian([relation])])
            if _rank(more) > rank:
                rows, rank = more, _rank(more)
                out.append(str(relation))
        return out

    def error(self, program: Program, mean: bool = False) -> float:
        """Root mean square of the errors of all shown numbers: sizes, places along axes, and tilts times the half diagonal of the leaf."""
        errors: list[float] = []
        for i, (true, p) in enumerate(zip(self.parts, leaves(program), strict=True)):
            leaf = Leaf.of(p)
            errors += [leaf.length(name) - true.length(name) for name in SIZE_NAMES[true.kind] if self._shows_size(i, name)]
            for axis in range(3):
                along = true.frame[:, axis]
                if self._shows_center(i, along):
                    errors.append(float((leaf.center - true.center) @ along))
                if AXES[axis] in AXES_OF[true.kind] and self._shows_axis(i, AXES[axis]):
                    cosines = np.abs(leaf.frame.T @ along)
                    sine = float(np.linalg.norm(np.cross(leaf.frame[:, int(cosines.argmax())], along)))
                    errors.append(sine * float(np.linalg.norm(true.size)) / 2)
        if mean:
            return float(np.mean(np.abs(errors))) if errors else 0.0
        return float(np.sqrt(np.mean(np.square(errors)))) if errors else 0.0

    def _shows_size(self, leaf: int, name: str) -> bool:
        kind, faces = self.parts[leaf].kind, self.shown[leaf]
        if kind == "box":
            return {f"+{name[1]}", f"-{name[1]}"} <= faces
        return "r" in faces if name == "r" else {"+z", "-z"} <= faces

    def _shows_axis(self, leaf: int, axis: str) -> bool:
        kind, faces = self.parts[leaf].kind, self.shown[leaf]
        if kind == "cylinder":
            return bool(faces)
        seen = [a for a in AXES if {f"+{a}", f"-{a}"} & faces]
        return axis in seen or len(seen) == 2

    def _shows_center(self, leaf: int, along: np.ndarray) -> bool:
        part, faces = self.parts[leaf], self.shown[leaf]
        if part.kind == "sphere":
            return "r" in faces
        needed = [axis for axis in range(3) if abs(part.frame[:, axis] @ along) > 1e-4]
        if part.kind == "box":
            return all({f"+{AXES[a]}", f"-{AXES[a]}"} <= faces for a in needed)
        return (needed == [2] or "r" in faces) and (2 not in needed or {"+z", "-z"} <= faces)

    def _relations(self) -> Iterator[Constraint]:
        axes = [Ref(i, a) for i, p in enumerate(self.parts) for a in AXES_OF[p.kind] if self._shows_axis(i, a)]
        world = [Ref(-1, a) for a in AXES]
        yield from self._true(Constraint("parallel", pair) for pair in itertools.combinations([*world, *axes], 2) if pair[1].leaf >= 0)
        yield from self._true(Constraint("perpendicular", pair) for pair in itertools.combinations(axes, 2) if pair[0].leaf != pair[1].leaf)
        sizes = [Ref(i, n) for i, p in enumerate(self.parts) for n in SIZE_NAMES[p.kind] if self._shows_size(i, n)]
        for radius in (True, False):
            same = [s for s in sizes if (s.feature == "r") == radius]
            yield from self._true(Constraint("equal", pair) for pair in itertools.combinations(same, 2))
        aligned = not axes or any(self.holds(Constraint("parallel", (w, a))) for w in world for a in axes)
        for along in self._distinct([*(world if aligned else []), *axes]):
            yield from self._along(along)
        yield from self._lines(axes)
        centers = [Ref(i) for i in range(len(self.parts)) if all(self._shows_center(i, e) for e in np.eye(3))]
        yield from self._true(Constraint("concentric", pair) for pair in itertools.combinations(centers, 2))
        yield from self._patterns(axes)

    def _distinct(self, refs: list[Ref]) -> list[Ref]:
        out: list[Ref] = []
        for ref in refs:
            if not any(np.linalg.norm(np.cross(direction(self.parts, ref), direction(self.parts, o))) < EXACT for o in out):
                out.append(ref)
        return out

    def _along(self, along: Ref) -> Iterator[Constraint]:
        d = direction(self.parts, along)
        faces = [
            Ref(i, f)
            for i, p in enumerate(self.parts)
            for f in sorted(self.shown[i] - {"r"})
            if np.linalg.norm(np.cross(p.frame[:, AXES.index(f[1])], d)) < EXACT
        ]
        centers = [Ref(i) for i in range(len(self.parts)) if self._shows_center(i, d)]
        pairs = [p for p in itertools.combinations([*faces, *centers], 2) if p[0].leaf != p[1].leaf]
        yield from self._true(Constraint("aligned", pair, along) for pair in pairs)
        for a, b in itertools.combinations(centers, 2):
            if self._alike(a.leaf, b.leaf) and abs((self.parts[a.leaf].center - self.parts[b.leaf].center) @ d) > 1e-3:
                middles = [c for c in centers if c.leaf not in (a.leaf, b.leaf)]
                yield from self._true(Constraint("symmetric", (a, b, c), along) for c in middles)

    def _lines(self, axes: list[Ref]) -> Iterator[Constraint]:
        """Cylinders about one line and spheres on it."""
        lines = [a for a in axes if self.parts[a.leaf].kind == "cylinder" and "r" in self.shown[a.leaf]]
        balls = [Ref(i) for i, p in enumerate(self.parts) if p.kind == "sphere" and "r" in self.shown[i]]
        for a in lines:
            parallel = [b for b in lines if b.leaf > a.leaf and self.holds(Constraint("parallel", (a, b)))]
            yield from self._true(Constraint("coaxial", (a, b)) for b in [*parallel, *balls])

    def _patterns(self, axes: list[Ref]) -> Iterator[Constraint]:
        for group in self._groups():
            yield from self._true(
                Constraint("linear", (Ref(i), Ref(j), Ref(k))) for i, k in itertools.combinations(group, 2) for j in group
            )
            for about in axes:
                yield from self._rings(group, about)

    def _rings(self, group: list[int], about: Ref) -> Iterator[Constraint]:
        axis = direction(self.parts, about)
        u, v = (
            self.parts[about.leaf].frame[:, (AXES.index(about.feature) + 1) % 3],
            self.parts[about.leaf].frame[:, (AXES.index(about.feature) + 2) % 3],
        )
        if not (self._shows_center(about.leaf, u) and self._shows_center(about.leaf, v)):
            return
        members = [i for i in group if i != about.leaf and self._shows_center(i, u) and self._shows_center(i, v)]
        offsets = np.array([[(self.parts[i].center - self.parts[about.leaf].center) @ w for w in (u, v)] for i in members]).reshape(-1, 2)
        radius = np.linalg.norm(offsets, axis=1)
        for r in sorted({round(float(x), 5) for x in radius if x > 1e-3}):
            ring = [m for m, x in zip(members, radius, strict=True) if abs(x - r) < 2e-5]
            angle = {m: math.atan2(*offsets[members.index(m)][::-1]) for m in ring}
            ring.sort(key=lambda m: angle[m])
            if len(ring) > 1:
                assert axis is not None
                yield from self._true([Constraint("circular", tuple(Ref(m) for m in ring), about)])

    def _groups(self) -> list[list[int]]:
        groups: list[list[int]] = []
        for i in range(len(self.parts)):
            home = next((g for g in groups if self._alike(g[0], i)), None)
            if home is None:
                groups.append([i])
            else:
                home.append(i)
        return [g for g in groups if len(g) > 1]

    def _alike(self, i: int, j: int) -> bool:
        a, b = self.parts[i], self.parts[j]
        if a.kind != b.kind:
            return False
        names = [n for n in SIZE_NAMES[a.kind] if self._shows_size(i, n) and self._shows_size(j, n)]
        return all(abs(a.length(n) - b.length(n)) < EXACT for n in names)

    def _true(self, candidates) -> Iterator[Constraint]:
        for c in candidates:
            if len({*c.of}) == len(c.of) and self.holds(c) and self._steps(c):
                yield c

    def _steps(self, c: Constraint) -> bool:
        """Rows need steps, and cylinders in a row a place across their axis that shows."""
        if c.kind != "linear":
            return True
        frames = self.parts[c.of[0].leaf].frame
        sides = frames.T[:2] if self.parts[c.of[0].leaf].kind == "cylinder" else frames.T
        far = np.abs(place(self.parts, c.of[0]) - place(self.parts, c.of[1])).max() > 1e-3
        return far and all(self._shows_center(ref.leaf, side) for ref in c.of for side in sides)

    def _jacobian(self, relations: Sequence[Constraint]) -> np.ndarray:
        """Derivatives [m, 9 k] by central differences, rows of unit length; rows that feel nothing are left out."""
        out = [np.zeros((0, 9 * len(self.parts)))]
        for c in relations:
            involved = sorted({ref.leaf for ref in (*c.of, *((c.about,) if c.about else ())) if ref.leaf >= 0})
            columns = {}
            for leaf in involved:
                for k in range(9):
                    step = np.zeros(9)
                    step[k] = 1e-4
                    ahead, behind = (
                        gap(c, [*self.parts[:leaf], self.parts[leaf].moved(s), *self.parts[leaf + 1 :]]) for s in (step, -step)
                    )
                    columns[9 * leaf + k] = (ahead - behind) / 2e-4
            rows = np.zeros((len(gap(c, self.parts)), 9 * len(self.parts)))
            for column, slope in columns.items():
                rows[:, column] = slope
            size = np.linalg.norm(rows, axis=1)
            out.append(rows[size > 1e-3] / size[size > 1e-3, None])
        return np.vstack(out)


def _rank(rows: np.ndarray) -> int:
    """Differences and single precision leave errors near 1e-4."""
    return int((np.linalg.svd(rows, compute_uv=False) > 2e-3).sum()) if rows.size else 0


def shown_faces(parts: Leaves, points: np.ndarray) -> list[set[str]]:
    """The faces of each leaf that at least LEAST_POINTS of the exact surface points lie on, and on no other leaf's."""
    on: list[dict[str, np.ndarray]] = []
    for p in parts:
        local = (points - p.center) @ p.frame
        on.append(_box_faces(p, local) if p.kind == "box" else _round_faces(p, local))
    out: list[set[str]] = []
    for i, faces in enumerate(on):
        others = np.zeros(len(points), bool)
        for j, theirs in enumerate(on):
            if j != i:
                others |= np.any(list(theirs.values()), axis=0)
        out.append({name for name, mask in faces.items() if (mask & ~others).sum() >= LEAST_POINTS})
    return out


def _box_faces(p: Leaf, local: np.ndarray) -> dict[str, np.ndarray]:
    inside = np.abs(local) <= p.size / 2 + EXACT
    return {
        f: inside.all(1) & (np.abs((1 if f[0] == "+" else -1) * local[:, AXES.index(f[1])] - p.half(f[1])) < EXACT) for f in FACES["box"]
    }


def _round_faces(p: Leaf, local: np.ndarray) -> dict[str, np.ndarray]:
    if p.kind == "sphere":
        return {"r": np.abs(np.linalg.norm(local, axis=1) - p.size[0]) < EXACT}
    rho, half = np.hypot(local[:, 0], local[:, 1]), p.size[1] / 2
    caps = {f: (rho <= p.size[0] + EXACT) & (np.abs((1 if f[0] == "+" else -1) * local[:, 2] - half) < EXACT) for f in ("+z", "-z")}
    return {**caps, "r": (np.abs(rho - p.size[0]) < EXACT) & (np.abs(local[:, 2]) <= half + EXACT)}
