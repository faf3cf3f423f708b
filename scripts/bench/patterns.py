"""Which parts have equal features in a row, in a grid or on a circle, and whether the program found for them says so.

    python scripts/bench/patterns.py FOLDER                      lists the parts that have such features, by their meshes alone
    python scripts/bench/patterns.py FOLDER --results out/bench  and compares with program.json of each part (`benchmark.py` makes them)

Features are read off the mesh, with nothing of the package: smooth patches (edges below 25 degrees) that are curved, by the point or
axis that their normals meet at (balls, cylinders, cones; no others), their radius, and the axis's direction and extent, where cylinders
of one radius on one axis are one feature; and flat faces that stick out or lie deep on all sides (every edge convex, or every edge
concave), by area, shape and normal. Features count as equal within 1 %. Three or more with different centres make a pattern where they
stand at equal steps (rows; grids of two by two or more) or at equal angles round one centre (all the way round).

A part is met if its pattern with most features is: one repeat of the program takes one feature to at least four fifths of the others.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
import trimesh
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

SMOOTH_DEG = 25.0
EQUAL = 0.01  # of a feature's own numbers
PLACE = 2e-3  # of the part's diagonal
SLIVER = 1e-6  # of the part's area
ROUND = 0.03  # of a radius, by which lines miss the axis at most
FLAT_DEG = 0.1
MET = 0.8


@dataclass(frozen=True)
class Pattern:
    kind: str
    places: np.ndarray  # [n, 3]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--results", type=Path, help="holds a folder with program.json for each part, by name")
    parser.add_argument("--only", default="", help="parts by name, joined by commas")
    given = parser.parse_args()
    only = set(filter(None, given.only.split(",")))
    parts = sorted(p for p in given.folder.iterdir() if p.suffix in (".off", ".stl") and (not only or p.stem in only))
    met = listed = 0
    for part in parts:
        mesh = trimesh.load_mesh(part)
        mesh.merge_vertices()
        found = patterns(mesh)
        if not found:
            continue
        listed += 1
        largest = [p for p in found if len(p.places) == len(found[0].places)]
        line = f"{part.stem}: " + ", ".join(f"{len(p.places)} {p.kind}" for p in found)
        if given.results is not None:
            program = given.results / part.stem / "program.json"
            motions = repeats_of(json.loads(program.read_text())["program"]) if program.is_file() else []
            said = [any(explained(p, m, PLACE * mesh.scale * 5) for m in motions) for p in largest]
            met += any(said)
            line += "; met" if any(said) else f"; MISSED, the program has {', '.join(str(len(m)) for m in motions) or 'no'} copies"
        print(line, flush=True)
    print(f"{listed} of {len(parts)} parts have patterns")
    if given.results is not None and listed:
        print(f"{met} of {listed} come out as a repeat: {100 * met / listed:.0f} %")


# --- features of a mesh ----------------------------------------------------------------------------------------------


def patterns(mesh: trimesh.Trimesh) -> list[Pattern]:
    """Patterns among equal features, those with most first."""
    place = PLACE * float(mesh.scale)
    out: list[Pattern] = []
    for centers in equal_features(mesh, place):
        distinct = centers[np.unique(np.round(centers / place).astype(int), axis=0, return_index=True)[1]]
        while len(distinct) > 2:
            choices = [*rows_and_grids(distinct, place), *circles(distinct, place)]
            best = max(choices, key=lambda p: len(p.places), default=None)
            if best is None:
                break
            out.append(best)
            distinct = distinct[cKDTree(best.places).query(distinct)[0] > place]
    return sorted(out, key=lambda p: -len(p.places))


Feature = tuple[np.ndarray, np.ndarray]  # place [3], numbers that equal features share


def equal_features(mesh: trimesh.Trimesh, place: float) -> list[np.ndarray]:
    """Centres [n, 3] of the features of each class of equal ones."""
    curved, flat = [], []
    smooth = mesh.face_adjacency_angles < np.radians(SMOOTH_DEG)
    for faces in patches(mesh, smooth):
        if mesh.area_faces[faces].sum() < SLIVER * mesh.area:
            continue
        normals = mesh.face_normals[faces]
        (curved if np.ptp(normals, axis=0).max() > 0.05 else flat).append(faces)
    round_ones = [f for faces in curved for f in curved_feature(mesh, faces)]
    found = coaxial_as_one(round_ones, place) + [f for faces in flat for f in flat_feature(mesh, faces)]
    classes: list[list[int]] = []
    for i, (_, numbers) in enumerate(found):
        home = next((c for c in classes if _alike(found[c[0]][1], numbers, place)), None)
        if home is None:
            classes.append([i])
        else:
            home.append(i)
    return [np.array([found[i][0] for i in c]) for c in classes if len(c) > 2]


def _alike(a: np.ndarray, b: np.ndarray, place: float) -> bool:
    return len(a) == len(b) and bool((np.abs(a - b) <= np.maximum(EQUAL * np.abs(a), place * EQUAL)).all())


def patches(mesh: trimesh.Trimesh, smooth: np.ndarray) -> list[np.ndarray]:
    """Numbers of the faces that smooth edges join."""
    pairs = mesh.face_adjacency[smooth]
    graph = trimesh.graph.edges_to_coo(pairs, count=len(mesh.faces))
    count, labels = connected_components(graph, directed=False)
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.cumsum(np.bincount(labels, minlength=count))[:-1])


def curved_feature(mesh: trimesh.Trimesh, faces: np.ndarray) -> list[Feature]:
    """A ball's centre, or the middle of a cylinder's or cone's axis, and mean radius and extent; nothing of other faces.

    Edges between facets lie on the surface, and what halves the angle there points to the axis; points of facets do neither.
    """
    inside = np.zeros(len(mesh.faces), bool)
    inside[faces] = True
    bent = (mesh.face_adjacency_angles > np.radians(FLAT_DEG)) & inside[mesh.face_adjacency].all(1)
    pairs, ends = mesh.face_adjacency[bent], mesh.vertices[mesh.face_adjacency_edges[bent]]
    if len(pairs) < 2:
        return []
    normals = trimesh.unitize(mesh.face_normals[pairs].sum(1))
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    weights, middles = lengths / lengths.sum(), ends.mean(1)
    spread = mesh.face_normals[faces] - mesh.face_normals[faces].mean(0)
    values, vectors = np.linalg.eigh(spread.T @ spread / len(faces))
    axis, round_about = vectors[:, 0], values[0] < 1e-4
    lines = normals - np.outer(normals @ axis, axis) if round_about else normals
    lines = lines / np.maximum(np.linalg.norm(lines, axis=1), 1e-9)[:, None]
    across = np.eye(3) - lines[:, :, None] * lines[:, None, :] - (np.outer(axis, axis) if round_about else 0)
    mean = weights @ middles
    off = np.einsum("n,nij,nj->i", weights, across, middles - mean)
    center = mean + np.linalg.pinv(np.einsum("n,nij->ij", weights, across), rcond=1e-4) @ off
    missed = np.linalg.norm(np.einsum("nij,nj->ni", across, middles - center), axis=1)
    along = (mesh.vertices[np.unique(mesh.faces[faces])] - center) @ axis if round_about else np.zeros(1)
    radius = ((middles - center) * lines).sum(1)
    if np.sqrt(weights @ missed**2) > ROUND * np.abs(radius).mean():
        return []
    is_cylinder = round_about and np.abs(normals @ axis).max() < 1e-3
    tilt = axis * np.sign(axis[np.abs(axis).argmax()]) if round_about else np.zeros(3)
    numbers = [1.0 + is_cylinder, 1 + weights @ radius, np.ptp(along), *(1 + tilt)]
    return [(center + axis * 0.5 * (along.max() + along.min()), np.array(numbers))]


def coaxial_as_one(features: list[Feature], place: float) -> list[Feature]:
    """Cylinders of one radius on one axis, which one drill or one bar makes, as one feature from end to end."""
    out: list[Feature] = []
    for at, numbers in features:
        tilt = numbers[3:] - 1
        for i, (other, known) in enumerate(out):
            gap = at - other
            same = numbers[0] == known[0] == 2.0 and np.abs(numbers[[1, 3, 4, 5]] - known[[1, 3, 4, 5]]).max() <= place
            if same and np.linalg.norm(gap - gap @ tilt * tilt) <= place:
                ends = [e for p, n in ((at, numbers), (other, known)) for e in (p @ tilt - n[2] / 2, p @ tilt + n[2] / 2)]
                middle = other + (0.5 * (max(ends) + min(ends)) - other @ tilt) * tilt
                out[i] = (middle, np.array([2.0, known[1], max(ends) - min(ends), *known[3:]]))
                break
        else:
            out.append((at, numbers))
    return out


def flat_feature(mesh: trimesh.Trimesh, faces: np.ndarray) -> list[Feature]:
    """The middle of a face with all edges convex or all concave, its area, principal moments and normal; nothing of other faces."""
    inside = np.zeros(len(mesh.faces), bool)
    inside[faces] = True
    border = inside[mesh.face_adjacency].sum(1) == 1
    convex = mesh.face_adjacency_convex[border]
    middles, areas = mesh.triangles_center[faces], mesh.area_faces[faces]
    if not len(convex) or convex.any() != convex.all():
        return []
    mean = areas @ middles / areas.sum()
    corners = mesh.triangles[faces] - mean
    moments = np.linalg.eigvalsh(np.einsum("n,nci,ncj->ij", areas, corners, corners) / areas.sum())[1:]
    numbers = [3.0, areas.sum(), *np.sqrt(np.maximum(moments, 0)), float(convex.all()), *(1 + mesh.face_normals[faces[0]])]
    return [(mean, np.array(numbers))]


# --- where they stand ------------------------------------------------------------------------------------------------


def rows_and_grids(points: np.ndarray, place: float) -> list[Pattern]:
    """Rows of three or more, grids of two by two or more with right angles."""
    tree, out = cKDTree(points), []

    def at(p: np.ndarray) -> int | None:
        gap, i = tree.query(p)
        return int(i) if gap <= place else None

    for i in range(len(points)):
        runs = []
        for j in range(len(points)):
            step = points[j] - points[i]
            if i == j or at(points[i] - step) is not None:
                continue
            run = [i, j]
            while (k := at(points[i] + len(run) * (points[run[-1]] - points[i]) / (len(run) - 1))) is not None and k not in run:
                run.append(k)
            runs.append((step, run))
            if len(run) > 2:
                out.append(Pattern("in a row", points[run]))
        for (u, row), (v, column) in combinations(runs, 2):
            if abs(u @ v) > 1e-2 * np.linalg.norm(u) * np.linalg.norm(v):
                continue
            for width in range(2, len(row) + 1):
                cells = [[at(points[c] + points[r] - points[i]) for r in row[:width]] for c in column]
                full = next((n for n, line in enumerate(cells) if None in line), len(cells))
                if full > 1:
                    out.append(Pattern("in a grid", points[[k for line in cells[:full] for k in line]]))  # type: ignore[index]
    return out


def circles(points: np.ndarray, place: float) -> list[Pattern]:
    """Three or more at equal angles, all the way round."""
    out = []
    for triple in combinations(range(len(points)), 3) if len(points) <= 24 else ():
        a, b, c = points[list(triple)]
        normal = np.cross(b - a, c - a)
        if np.linalg.norm(normal) < 1e-3 * np.linalg.norm(b - a) * np.linalg.norm(c - a):
            continue
        normal /= np.linalg.norm(normal)
        u, v = b - a, c - a
        middle = a + np.cross(u @ u * v - v @ v * u, np.cross(u, v)) / (2 * np.cross(u, v) @ np.cross(u, v))
        radius = np.linalg.norm(a - middle)
        off = points - middle
        ring = np.flatnonzero((np.abs(np.linalg.norm(off, axis=1) - radius) <= place) & (np.abs(off @ normal) <= place))
        x = (a - middle) / radius
        angles = np.sort(np.arctan2(off[ring] @ np.cross(normal, x), off[ring] @ x))
        if len(ring) < 3:
            continue
        gaps = np.diff([*angles, angles[0] + 2 * np.pi]) - 2 * np.pi / len(ring)
        if np.abs(gaps).max() * radius <= 2 * place:
            out.append(Pattern("on a circle", points[ring]))
    return out


# --- what a program says ---------------------------------------------------------------------------------------------


def repeats_of(node: dict) -> list[list[np.ndarray]]:
    """For each repeat of three copies or more in a document, the motions [4, 4] of its copies; a repeat of a repeat has those of both."""
    parts = node.get("parts", [node["part"]] if "part" in node else [])
    below = [motions for part in parts for motions in repeats_of(part)]
    if "repeat" not in node:
        return below
    own, inner = motions_of(node), node["part"]
    while "repeat" in inner:
        own, inner = [a @ b for a in own for b in motions_of(inner)], inner["part"]
    return [own, *below] if len(own) > 2 else below


def motions_of(node: dict) -> list[np.ndarray]:
    if node["repeat"] == "linear":
        return [trimesh.transformations.translation_matrix(np.multiply(i, node["step"])) for i in range(node["count"])]
    if node["repeat"] == "grid":
        (n, m), (u, v) = node["counts"], np.array(node["steps"])
        return [trimesh.transformations.translation_matrix(i * u + j * v) for i in range(n) for j in range(m)]
    if node["repeat"] == "circular":
        angles = np.radians(node["angle"]) * np.arange(node["count"])
        return [trimesh.transformations.rotation_matrix(a, node["axis"], node["point"]) for a in angles]
    return [np.eye(4), trimesh.transformations.reflection_matrix(node["point"], node["normal"])]


def explained(pattern: Pattern, motions: list[np.ndarray], place: float) -> bool:
    """Whether the motions take one feature to at least MET of all."""
    tree = cKDTree(pattern.places)
    for start in pattern.places:
        for first in motions:
            back = np.linalg.inv(first)
            places = np.array([(m @ back @ [*start, 1.0])[:3] for m in motions])
            gaps, which = tree.query(places)
            if len(set(which[gaps <= place])) >= MET * len(pattern.places):
                return True
    return False


if __name__ == "__main__":
    main()
