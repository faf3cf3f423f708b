"""What of a result's surface a cloud shows: seen, inferred from what is seen, or unknown.

A place is seen where points are near, as dense as elsewhere. It is inferred where its face is seen elsewhere, so that only how far that
goes is open, or where what it repeats is seen: its image in a mirror plane that the points bear out, or in a copy of a pattern. The rest
closes the solid in the shortest way, and nobody knows.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from scipy.spatial import KDTree

from imdim.delivery.explanation import STRAY, is_bare
from imdim.delivery.surface_elements import FINENESS
from imdim.delivery.verdict import LEAST_LISTED, MOST_LISTED, percent, place_region
from imdim.detection.noise import NoiseModel
from imdim.export.surface_colours import COVERAGES, ColouredResult
from imdim.geometry import kernels
from imdim.geometry.components import components
from imdim.geometry.refine import split_edges
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.sampling import subsample
from imdim.geometry.shadows import slants
from imdim.numbers.likelihood import Noise
from imdim.program.motions import Motion, mirror
from imdim.program.repeats import Folded, repeats
from imdim.program.tree import Program, leaves

SEEN, INFERRED, UNKNOWN = range(3)
FACE, SYMMETRY, PATTERN = "its face goes on", "symmetry", "pattern"
MOST_ELEMENTS = 20_000  # unless the result's mesh has more faces
SMOOTH = math.cos(math.radians(12))  # between faces of one surface: chords of circles differ by less
MEASURED = 0.2  # share of a face that is seen, from which its place is known
SUPPORTED = 0.2  # share of what is seen whose mirror image is seen, from which a symmetry is borne out
MIRRORED = 0.99  # share of the surface whose mirror image is surface
ASKED = 600  # places that tell whether it is
MOST_LEAVES, MOST_COPIES = 24, 64  # whose mirror planes are tried; of one pattern whose motions are
LEAST_SLACK = 1e-3  # of the diagonal


@dataclass(frozen=True)
class UncoveredRegion:
    """A connected piece of the result's surface that is not seen: `coverage`, and what it is inferred `by`; empty where it is unknown.
    `share` of the surface; in words `what` it is, of which size, and `where`."""

    coverage: str
    by: str
    share: float
    what: str
    where: str


@dataclass(frozen=True, eq=False)
class Coverage:
    """`shares` of the result's surface by COVERAGES, `by` those of what is inferred, by from what; `regions` that are not seen, the largest
    first; `codes` [n], places in COVERAGES, of the faces of `mesh`."""

    shares: Mapping[str, float]
    by: Mapping[str, float]
    regions: tuple[UncoveredRegion, ...]
    mesh: trimesh.Trimesh
    codes: np.ndarray

    @property
    def coloured(self) -> ColouredResult:
        """As pictures draw it."""
        return ColouredResult(self.mesh, self.codes, {name: percent(share) for name, share in self.shares.items()})


def cover(
    program: Program,
    result: trimesh.Trimesh,
    points: np.ndarray,
    model: NoiseModel,
    folded: Folded | None = None,
    scanners: np.ndarray | None = None,
) -> Coverage:
    """The coverage of a `program`, whose surface `result` is, by a cloud of `points` [n, 3] with noise as in the `model`, as `scanners`
    [k, 3] saw it if they are known; `folded` is the program with its patterns. Raises ValueError for a result without faces."""
    if not len(result.faces):
        raise ValueError("a result without faces has no coverage")
    diagonal = float(np.linalg.norm(np.ptp(np.asarray(result.vertices), axis=0)))
    vertices, faces, parents = split_edges(np.asarray(result.vertices), np.asarray(result.faces), diagonal / FINENESS, MOST_ELEMENTS)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    places, normals = np.asarray(mesh.triangles_center), np.asarray(result.face_normals)[parents]
    noise = Noise(max(model.sigma, LEAST_SLACK * diagonal))
    near = points[np.abs(kernels.program_sdf(program, points)) <= STRAY * noise.sigma]
    seen = ~is_bare(places, near, noise)
    if scanners is not None:
        seen &= (slants(places, normals, scanners) > 0).any(0)
    surface = _Surface(program, places, normals, np.asarray(mesh.area_faces), seen, noise.sigma)
    codes, by = np.where(seen, SEEN, UNKNOWN), np.full(len(places), "", object)
    for reason, known in _inferences(surface, result, parents, folded):
        new = known & (codes == UNKNOWN)
        codes[new], by[new] = INFERRED, reason
    total = surface.areas.sum()
    shares = np.bincount(codes, surface.areas, len(COVERAGES)) / total
    regions = sorted(_regions(surface, mesh, codes, by), key=lambda r: -r.share)[:MOST_LISTED]
    reasons = {reason: float(surface.areas[by == reason].sum() / total) for reason in (FACE, SYMMETRY, PATTERN)}
    named: dict[str, float] = dict(zip(COVERAGES, shares.tolist(), strict=True))
    return Coverage(named, {k: v for k, v in reasons.items() if v > 0}, tuple(regions), mesh, codes)


@dataclass(frozen=True, eq=False)
class _Rigid:
    """``world -> linear @ world + shift``."""

    linear: np.ndarray
    shift: np.ndarray

    @staticmethod
    def of(motion: Motion) -> _Rigid:
        return _Rigid(np.array(motion.linear), np.array(motion.shift))

    def after_inverse(self, other: _Rigid) -> _Rigid:
        """First back to where `other` comes from, and then this."""
        linear = self.linear @ other.linear.T
        return _Rigid(linear, self.shift - linear @ other.shift)


@dataclass(frozen=True, eq=False)
class _Surface:
    """Elements of a program's surface, their `places` and outward `normals` [n, 3] and `areas` [n], which of them are `seen`, and by how
    much places of one surface may differ."""

    program: Program
    places: np.ndarray
    normals: np.ndarray
    areas: np.ndarray
    seen: np.ndarray
    slack: float

    def images(self, motion: _Rigid, chosen: np.ndarray) -> np.ndarray:
        """Which elements the `chosen` ones [k] come to lie on; -1 where that is not on the surface."""
        moved, along = self.places[chosen] @ motion.linear.T + motion.shift, self.normals[chosen] @ motion.linear.T
        behind, ahead = (kernels.inside(self.program, moved + side * self.slack * along) for side in (-2.0, 2.0))
        on = behind & ~ahead
        return np.where(on, self._tree.query(moved)[1], -1)

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.places)


def _inferences(surface: _Surface, result: trimesh.Trimesh, parents: np.ndarray, folded: Folded | None) -> Iterator[tuple[str, np.ndarray]]:
    """What is inferred [n] from what, the surest first."""
    yield FACE, _of_measured_faces(surface, result, parents)
    mirrors = [*_mirrors(surface)] if not surface.seen.all() else []
    # of two planes that cross, what lies on the far side of both is the image of an image
    yield SYMMETRY, _reach(surface, [*mirrors, *mirrors, *mirrors])
    yield PATTERN, _reach(surface, _pattern_motions(folded))


def _reach(surface: _Surface, motions: Iterable[_Rigid]) -> np.ndarray:
    """Which elements [n] have an image, one motion after the other, that is seen."""
    known = surface.seen.copy()
    for motion in motions:
        hidden = np.flatnonzero(~known)
        image = surface.images(motion, hidden) if len(hidden) else hidden
        known[hidden] = (image >= 0) & known[image]
    return known


def _of_measured_faces(surface: _Surface, result: trimesh.Trimesh, parents: np.ndarray) -> np.ndarray:
    """Which elements [n] are on smooth faces of the result that are seen well enough."""
    a, b = np.asarray(result.face_adjacency, np.int64).reshape(-1, 2).T
    normals = np.asarray(result.face_normals)
    smooth = np.einsum("ni,ni->n", normals[a], normals[b]) > SMOOTH
    count, face = components(a[smooth], b[smooth], len(normals))
    own = face[parents]
    area, shown = (np.bincount(own, surface.areas * weight, count) for weight in (1.0, surface.seen))
    return (shown > MEASURED * area)[own]


def _mirrors(surface: _Surface) -> Iterator[_Rigid]:
    """Mirror planes of the leaves that are the whole program's, and that what is seen bears out: enough of it has its image in what is."""
    some = subsample(np.arange(len(surface.places)), ASKED)
    shown = np.flatnonzero(surface.seen)
    tried = set[tuple[float, ...]]()
    for leaf in sorted(leaves(surface.program), key=lambda p: -math.prod(p.size))[:MOST_LEAVES]:
        for axis in matrix_from_euler(leaf.rotation).T:
            normal = axis * (1.0 if axis[np.abs(axis).argmax()] > 0 else -1.0)
            key = (*np.round(normal, 3).tolist(), round(float(normal @ np.array(leaf.center)) / surface.slack))
            if key in tried or not len(shown):
                continue
            tried.add(key)
            x, y, z = (normal / np.linalg.norm(normal)).tolist()
            motion = _Rigid.of(mirror(leaf.center, (x, y, z)))
            on = surface.images(motion, some) >= 0
            if surface.areas[some][on].sum() < MIRRORED * surface.areas[some].sum():
                continue
            image = surface.images(motion, shown)
            twice = (image >= 0) & surface.seen[image]
            if surface.areas[shown][twice].sum() >= SUPPORTED * surface.areas[shown].sum():
                yield motion


def _pattern_motions(folded: Folded | None) -> Iterator[_Rigid]:
    """From each copy of a pattern to each other, each motion once: those of a row are few."""
    known = set[bytes]()
    for _, repeat in [] if folded is None else repeats(folded):
        copies = [_Rigid.of(motion) for motion in itertools.islice(repeat.motions(), MOST_COPIES)]
        for motion in (to.after_inverse(start) for start in copies for to in copies if start is not to):
            key = (np.round(np.column_stack([motion.linear, motion.shift]), 6) + 0.0).tobytes()
            if key not in known:
                known.add(key)
                yield motion


def _regions(surface: _Surface, mesh: trimesh.Trimesh, codes: np.ndarray, by: np.ndarray) -> Iterator[UncoveredRegion]:
    a, b = np.asarray(mesh.face_adjacency, np.int64).reshape(-1, 2).T
    joined = (codes[a] == codes[b]) & (by[a] == by[b])
    count, label = components(a[joined], b[joined], len(codes))
    diagonal = float(np.linalg.norm(np.ptp(np.asarray(mesh.vertices), axis=0)))
    total, areas = surface.areas.sum(), np.bincount(label, surface.areas * (codes != SEEN), count)
    for number in np.argsort(-areas, kind="stable")[:MOST_LISTED]:
        if areas[number] >= LEAST_LISTED * total:
            own = label == number
            corners = np.asarray(mesh.vertices)[mesh.faces[own]].reshape(-1, 3)
            facing = surface.areas[own] @ surface.normals[own] / surface.areas[own].sum()
            what, where = place_region(corners, facing, diagonal)
            yield UncoveredRegion(COVERAGES[codes[own][0]], str(by[own][0]), float(areas[number] / total), what, where)


def describe_coverage(coverage: Coverage) -> str:
    """The shares in words; of what is inferred also from what."""
    reasons = ", ".join(f"{reason} {percent(share)}" for reason, share in coverage.by.items())
    said = {name: f"{percent(share)} {name}" for name, share in coverage.shares.items()}
    said["inferred"] += f" ({reasons})" if reasons else ""
    return ", ".join(said.values())
