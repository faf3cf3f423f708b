"""A target's surface in small elements, each with the distance that the target itself leaves open there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from scipy.spatial import KDTree

from imdim.detection.cloud_normals import estimate_normals
from imdim.detection.faceting import ON_SURFACE, chord_heights
from imdim.detection.facets import Facets, MeshSurfaceConfig, facets_of
from imdim.detection.noise import MeasuredNoise, NoiseModel, measure_noise
from imdim.geometry.metrics import diagonal
from imdim.geometry.refine import split_edges
from imdim.geometry.sampling import subsample
from imdim.geometry.solid import SEGMENTS
from imdim.target.target import Target

FINENESS = 40  # elements along the diagonal of a mesh
MOST_ELEMENTS = 30_000  # unless the mesh has more faces
MOST_POINTS = 20_000  # of a cloud
NOISE_SEED = 0
DEVIATIONS = 3.0  # of the noise
NEIGHBOURS = 6  # of a point of a cloud, as of a cell of a honeycomb


@dataclass(frozen=True, eq=False)
class SurfaceElements:
    """n small pieces of a surface: faces of a refined mesh, or points of a cloud with what each stands for.

    `points`, unit `normals` [n, 3] (of either sign where `oriented` is False) and `areas` [n]; `tolerance` [n] is how far the surface meant
    may lie from the one given. `links` [m, 2] are neighbours, `lengths` [m] the edges between them, `smooth` [m] tells whether the surface
    goes on without an edge there. `facet` [n] are of `facets`, the target's flat ones, and `mesh` has a face for each element; both are
    None for a cloud, which has a `noise`.
    """

    points: np.ndarray
    normals: np.ndarray
    areas: np.ndarray
    tolerance: np.ndarray
    links: np.ndarray
    lengths: np.ndarray
    smooth: np.ndarray
    facet: np.ndarray
    facets: Facets | None
    oriented: bool
    mesh: trimesh.Trimesh | None
    noise: NoiseModel | None = None

    @cached_property
    def diagonal(self) -> float:
        """Of the box around all of them; every region asks for it."""
        return diagonal(self.points)

    def corners(self, chosen: np.ndarray) -> np.ndarray:
        """Points [k, 3] around the chosen elements [n] bool."""
        return self.points[chosen] if self.mesh is None else np.asarray(self.mesh.vertices)[self.mesh.faces[chosen]].reshape(-1, 3)


def elements_of(target: Target, segments: int = SEGMENTS, noise: MeasuredNoise | None = None) -> SurfaceElements:
    """The elements of a target; a result to be judged by them has `segments` edges per circle. Its `noise` is measured unless it was."""
    noise = noise or MeasuredNoise(*measure_noise(target.points, np.random.default_rng(NOISE_SEED)))
    return _of_cloud(target, segments, noise) if target.mesh is None else _of_mesh(target.mesh, segments, noise.model)


def _of_mesh(mesh: trimesh.Trimesh, segments: int, noise: NoiseModel) -> SurfaceElements:
    facets = facets_of(mesh)
    height, radius = chord_heights(facets)
    # a scan is noisy; a mesh's chords lie off the curve, and so do the result's
    tolerance = ON_SURFACE * facets.diagonal + DEVIATIONS * noise.sigma + height + radius * (1 - math.cos(math.pi / segments))
    vertices, faces, parents = split_edges(np.asarray(mesh.vertices), np.asarray(mesh.faces), facets.diagonal / FINENESS, MOST_ELEMENTS)
    fine = trimesh.Trimesh(vertices, faces, process=False)
    links = np.asarray(fine.face_adjacency, np.int64).reshape(-1, 2)
    ends = vertices[np.asarray(fine.face_adjacency_edges, np.int64).reshape(-1, 2)]
    facet = facets.facet_of[parents]
    normals = facets.normals[facet]
    cosine = (normals[links[:, 0]] * normals[links[:, 1]]).sum(1)
    return SurfaceElements(
        points=vertices[faces].mean(1),
        normals=normals,
        areas=np.asarray(fine.area_faces),
        tolerance=tolerance[facet],
        links=links,
        lengths=np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1),
        smooth=cosine > math.cos(math.radians(MeshSurfaceConfig.smooth_deg)),
        facet=facet,
        facets=facets,
        oriented=True,
        mesh=fine,
    )


def _of_cloud(target: Target, segments: int, measured: MeasuredNoise) -> SurfaceElements:
    noise, kept = measured.model, np.arange(len(target.points)) if measured.kept is None else measured.kept
    kept = subsample(np.sort(kept), MOST_POINTS)
    points = target.points[kept]
    chosen = np.random.default_rng(NOISE_SEED)
    normals = estimate_normals(points, noise, chosen)[0] if target.normals is None else target.normals[kept]
    away, near = (np.asarray(found) for found in KDTree(points).query(points, k=NEIGHBOURS + 1))
    links = np.column_stack([np.repeat(np.arange(len(points)), NEIGHBOURS), near[:, 1:].ravel()])
    links = np.unique(np.sort(links, axis=1), axis=0)
    spacing = float(np.median(away[:, -1])) * math.sqrt(math.pi / NEIGHBOURS)
    size = diagonal(points)
    tolerance = DEVIATIONS * noise.sigma + ON_SURFACE * size + size / 2 * (1 - math.cos(math.pi / segments))
    return SurfaceElements(
        points=points,
        normals=normals,
        areas=np.full(len(points), spacing**2),
        tolerance=np.full(len(points), tolerance),
        links=links,
        lengths=np.full(len(links), spacing / math.sqrt(3)),
        smooth=np.ones(len(links), bool),
        facet=np.arange(len(points)),
        facets=None,
        oriented=target.normals is not None,
        mesh=None,
        noise=noise,
    )
