"""Flat facets of a triangle mesh: triangles grown into maximal coplanar pieces, with the smooth edges between them.

And what growing carriers over them needs: tolerances, and which facets are free with their smooth neighbours."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from numba import njit
from scipy.sparse import csr_array

FEW = 64  # facets, of which each is looked up by itself

COPLANAR = 5e-6  # of the diagonal: corners no farther from a plane lie in it
COPLANAR_DEG = 1.0  # between the normals of triangles in one plane
STRAIGHT = 1e-5  # of the diagonal, by which a facet's boundary leaves the line between its neighbours in what is no corner of it
STRAIGHT_SINE = 5e-3  # of the turn there, at most: a fine polygon turns by more


@dataclass(frozen=True)
class Facets:
    """A mesh [f triangles] seen as u flat facets.

    `corners` [f, 3, 3] triangle corners; `facet_of` [f]; `normals` [u, 3], `centers` [u, 3], `areas` [u]; `edges` [e, 2] pairs of
    facets that meet in a mesh edge and `angles` [e] between their normals in radians (each pair once); `diagonal` of the mesh's box.
    """

    corners: np.ndarray
    facet_of: np.ndarray
    normals: np.ndarray
    centers: np.ndarray
    areas: np.ndarray
    edges: np.ndarray
    angles: np.ndarray
    diagonal: float

    @cached_property
    def _by_facet(self) -> tuple[np.ndarray, np.ndarray]:
        """The triangles [f] facet after facet, and where each facet's begin [u + 1]."""
        return np.argsort(self.facet_of, kind="stable"), np.cumsum(np.append(0, self.triangle_counts))

    @cached_property
    def triangle_counts(self) -> np.ndarray:
        """How many triangles each facet has [u]."""
        return np.bincount(self.facet_of, minlength=len(self.areas))

    @cached_property
    def triangle_areas(self) -> np.ndarray:
        """The area of each triangle [f]."""
        first, *others = self.corners.transpose(1, 0, 2)
        return np.linalg.norm(np.cross(*(corner - first for corner in others)), axis=1) / 2

    @cached_property
    def volume(self) -> float:
        """What the mesh encloses, if it does."""
        middle = self.corners.reshape(-1, 3).mean(0)
        return abs(float(np.linalg.det(self.corners - middle).sum())) / 6

    @cached_property
    def distinct(self) -> tuple[np.ndarray, np.ndarray]:
        """The distinct corners [v, 3], in order, and for each triangle [f, 3] their numbers."""
        points, place = np.unique(self.corners.reshape(-1, 3), axis=0, return_inverse=True)
        return points, place.reshape(-1, 3)

    @cached_property
    def turns(self) -> np.ndarray:
        """Which corners of triangles [f, 3] are corners of their facets. Others lie within a facet, or its boundary goes straight on in
        them, since only what is beside it was cut there: they are on chords of the curve. Where too few are left for a polygon, all are."""
        out = np.ones((len(self.corners), 3), bool)
        points, number = self.distinct
        several = np.flatnonzero(self.triangle_counts[self.facet_of] > 1)
        starts, ends = number[several].ravel(), np.roll(number[several], -1, 1).ravel()
        owners = np.repeat(self.facet_of[several], 3) * len(points)
        low, high = np.minimum(starts, ends), np.maximum(starts, ends)
        _, edge, met = np.unique((owners + low) * len(points) + high, return_inverse=True, return_counts=True)
        rim = met[edge] == 1  # no other triangle of the facet shares it
        leaving, entering = owners[rim] + starts[rim], owners[rim] + ends[rim]
        places, arrive, leave = np.intersect1d(_once(entering)[0], _once(leaving)[0], return_indices=True)
        into, away = _once(entering)[1][arrive], _once(leaving)[1][leave]
        straight = _are_straight(points[starts[rim][into]], points[starts[rim][away]], points[ends[rim][away]], self.diagonal)
        corners = np.setdiff1d(leaving, places[straight])
        out[several] = np.isin(owners + starts, corners).reshape(-1, 3)
        few = np.bincount(corners // len(points), minlength=len(self.areas)) < 3
        return out | few[self.facet_of][:, None]

    def triangles(self, facets: np.ndarray) -> np.ndarray:
        """Indices of the triangles of the given facets."""
        if len(facets) < FEW:
            order, starts = self._by_facet
            return np.sort(np.concatenate([order[starts[i] : starts[i + 1]] for i in set(facets.tolist())] or [order[:0]]))
        chosen = np.zeros(len(self.areas), bool)
        chosen[facets] = True
        return np.flatnonzero(chosen[self.facet_of])


def _once(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The keys that occur once, in order, and where."""
    values, first, count = np.unique(keys, return_index=True, return_counts=True)
    return values[count == 1], first[count == 1]


def _are_straight(before: np.ndarray, at: np.ndarray, after: np.ndarray, diagonal: float) -> np.ndarray:
    """Whether paths through points [n, 3] go straight on in the middle one."""
    first, second = at - before, after - at
    cross = np.linalg.norm(np.cross(first, second), axis=1)
    gentle = cross < STRAIGHT_SINE * np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    return gentle & ((first * second).sum(1) > 0) & (cross < STRAIGHT * diagonal * np.linalg.norm(after - before, axis=1))


@njit(cache=True)
def _grow(order, starts, neighbours, corners, normals, flat, cosine):
    """Flood coplanar triangles from the largest triangle down; every member lies within `flat` of the first triangle's plane."""
    facet = np.full(len(order), -1, np.int64)
    stack = np.empty(len(order), np.int64)
    count = 0
    for seed in order:
        if facet[seed] >= 0:
            continue
        n, p = normals[seed], corners[seed, 0]
        facet[seed] = count
        stack[0], top = seed, 1
        while top:
            top -= 1
            at = stack[top]
            for k in range(starts[at], starts[at + 1]):
                other = neighbours[k]
                if facet[other] >= 0 or (normals[other] * n).sum() < cosine:
                    continue
                far = 0.0
                for c in range(3):
                    far = max(far, abs(((corners[other, c] - p) * n).sum()))
                if far < flat:
                    facet[other] = count
                    stack[top] = other
                    top += 1
        count += 1
    return facet


def facets_of(mesh: trimesh.Trimesh) -> Facets:
    """Group the triangles of `mesh`."""
    diagonal = float(np.linalg.norm(mesh.extents))
    corners = np.ascontiguousarray(mesh.vertices[mesh.faces], dtype=float)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.linalg.norm(cross, axis=1)
    normals = cross / np.maximum(double, 1e-300)[:, None]
    pairs = np.asarray(mesh.face_adjacency, np.int64).reshape(-1, 2)
    ways = np.concatenate([pairs, pairs[:, ::-1]]).T
    links = csr_array((np.ones(ways.shape[1], bool), (ways[0], ways[1])), shape=(len(corners), len(corners)))
    order = np.argsort(-double, kind="stable")
    member = _grow(order, links.indptr, links.indices, corners, normals, COPLANAR * diagonal, np.cos(np.radians(COPLANAR_DEG)))
    areas = np.bincount(member, double / 2)
    mean_normal = np.stack([np.bincount(member, normals[:, i] * double) for i in range(3)], axis=1)
    mean_normal /= np.maximum(np.linalg.norm(mean_normal, axis=1, keepdims=True), 1e-300)
    middle = corners.mean(1)
    centers = np.stack([np.bincount(member, middle[:, i] * double) for i in range(3)], axis=1) / np.maximum(2 * areas, 1e-300)[:, None]
    edges = np.unique(np.sort(member[pairs], axis=1), axis=0)
    edges = edges[edges[:, 0] != edges[:, 1]]
    angles = np.arccos(np.clip((mean_normal[edges[:, 0]] * mean_normal[edges[:, 1]]).sum(1), -1, 1))
    return Facets(corners, member, mean_normal, centers, areas, edges, angles, diagonal)


@dataclass(frozen=True)
class MeshSurfaceConfig:
    """Tolerances relative to the diagonal, angles in degrees."""

    on_surface: float = 2e-4  # corner to carrier
    loose: float = 8e-4  # the same in the second pass
    smooth_deg: float = 46.0  # facets that meet under more are not one smooth surface (an octagon still is)
    follow_deg: float = 24.0  # facet normal to carrier normal at the facet's corners
    wide_span: float = 2.6  # a facet spanning this many times the typical angle is a flat, not a part of the curve
    max_failures: int = 150
    most_work: int = 40_000_000  # triangles looked at, per pass; it ends the search for curves on huge or noisy meshes
    max_planes: int = 160
    least_plane: float = 2e-7  # of the squared diagonal
    same_plane_deg: float = 0.3
    elliptic: bool = True  # whether elliptic cylinders are looked for: only outlines can say them


@dataclass
class Growing:
    """What the hypotheses share: which facets are free, and each facet's smooth neighbours."""

    facets: Facets
    free: np.ndarray
    neighbours: list[list[int]]
    config: MeshSurfaceConfig
    spent: int = 0  # triangles looked at


def points_of(facets: Facets, chosen: np.ndarray) -> np.ndarray:
    """Distinct corners [n, 3] of the chosen facets, in order."""
    points, place = facets.distinct
    shown = np.zeros(len(points), bool)
    triangles = facets.triangles(chosen)
    shown[place[triangles][facets.turns[triangles]]] = True
    return points[shown]
