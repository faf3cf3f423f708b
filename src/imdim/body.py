"""What a body shows: its surfaces, the cells between them labelled inside or outside, and the families of candidates over them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.evidence import Evidence
from imdim.geometry import kernels
from imdim.geometry.cloud import InputError, Target
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.geometry.surface import Patch, Surface
from imdim.geometry.winding import inside_mesh
from imdim.program.cost import count
from imdim.program.tree import Program
from imdim.search.arrangement import ArrangementConfig, arrange
from imdim.search.cells import Cells, Samples, compressed, label_samples
from imdim.search.families import Families
from imdim.seeding.closing import closing_planes
from imdim.seeding.cloud_normals import measure_scale
from imdim.seeding.cloud_surfaces import detect_cloud
from imdim.seeding.mesh_surfaces import detect_patches

ENOUGH_POINTS = 8192  # of a noisy cloud: as many are looked at when its numbers are fitted
NOISY = 1e-3  # deviation of a cloud's noise, as a share of its diagonal, from which edges and walls are blurred
SAMPLES = 150_000  # labelled, spread over the cells
CLOSING_AREA = 1e-7  # of the squared diagonal; implied planes rank behind detected ones


class UnseenError(InputError):
    """A body shows no surface or no inside; `cut`: time had run out before all of it was looked at."""

    def __init__(self, message: str, cut: bool = False) -> None:
        super().__init__(message)
        self.cut = cut


@dataclass(frozen=True)
class Seen:
    """What detection and labelling know of one body, all in its unit frame, the programs that are asked about too.

    `sigma` is the deviation of a cloud's noise. `label` gives the probability of being inside [n] for points [n, 3]. `cut` says whether
    time ended the look at a cloud.
    """

    target: Target
    patches: list[Patch]
    samples: Samples
    families: Families
    size_weight: float
    label: Callable[[np.ndarray], np.ndarray]
    sigma: float = 0.0
    cut: bool = False

    @cached_property
    def evidence(self) -> Evidence:
        """What evolution and the front need to know."""
        mesh = self.target.mesh
        area = sum(p.area for p in self.patches) if mesh is None else float(mesh.area)
        surfaces = [p.surface for p in self.patches]
        return Evidence(surfaces, self.families, self.samples, self.target.points, area, self.size_weight, mesh is not None)

    @property
    def noisy(self) -> bool:
        """Whether the noise of the body's cloud blurs its edges and walls, so that distances alone mislead."""
        return self.target.mesh is None and self.sigma > NOISY

    @property
    def cells(self) -> Cells:
        return self.families.cells

    def error(self, program: Program) -> float:
        """Volume in which the body and a program differ over the samples, relative to the body's."""
        samples = self.samples
        inside = kernels.inside(program, samples.points)
        return float(np.where(inside, samples.w_out, samples.w_in).sum()) / self.cells.volume

    def price(self, program: Program) -> float:
        """The search's objective, relative to the body's volume."""
        return self.error(program) + self.size_weight * count(program).primitives

    @cached_property
    def solid(self) -> Manifold | None:
        """The solid that the body's mesh bounds; None for a cloud, and for a mesh that bounds none."""
        try:
            return None if self.target.mesh is None else mesh_to_manifold(self.target.mesh)
        except ValueError:
            return None

    def iou(self, program: Program) -> float | None:
        """Volume IoU of a program with the solid, by exact booleans; None where there is no solid."""
        return None if self.solid is None else volume_iou(to_manifold(program), self.solid)

    def exact_price(self, program: Program) -> float:
        """As `price`, with the exact volumes where there is a solid: samples may all have missed what a program gets wrong."""
        iou = self.iou(program)
        return self.price(program) if iou is None else 1 - iou + self.size_weight * count(program).primitives


def look(
    unit: Target,
    size_weight: float,
    rng: np.random.Generator,
    detect_by: Deadline = NEVER,
    label_by: Deadline = NEVER,
) -> Seen:
    """Surfaces, cells and candidate families of a body, which is in its unit frame.

    Of a cloud, no more surfaces are looked for past `detect_by`, and no more samples are asked for their side past `label_by` (by default
    all are). Raises UnseenError.
    """
    unit = uncrowded(unit)
    patches, closing = _surfaces(unit, rng, detect_by)
    cut = unit.mesh is None and detect_by.passed()
    if not patches:
        raise UnseenError(f"{unit.name}: no plane, sphere, cylinder, cone or torus found in {len(unit.points)} points", cut)
    sigma = 0.0 if unit.mesh is not None else measure_scale(unit.points, np.random.default_rng(0)).sigma
    corners = _corners(unit, patches, sigma)
    bounds = np.stack([np.min(corners, axis=0), np.max(corners, axis=0)])
    surfaces = [p.surface for p in patches] + closing
    areas = [p.area for p in patches] + [CLOSING_AREA] * len(closing)
    arrangement = arrange(surfaces, areas, bounds, ArrangementConfig())
    label = _labeller(unit, patches, label_by)
    samples = label_samples(arrangement, label, SAMPLES, rng)
    cut = cut or (unit.mesh is None and label_by.passed())
    cells = compressed(arrangement, samples)
    if not (cells.gain > 0).any():
        raise UnseenError(f"{unit.name}: no inside found, 0 of {len(cells.points)} sampled cells", cut)
    return Seen(unit, patches, samples, Families(arrangement, cells), size_weight, label, sigma, cut)


def uncrowded(target: Target) -> Target:
    """The target; of a cloud whose neighbours lie nearer than the noise so many points that they do not.

    Neighbours within the noise lie in a ball: they show no face, take the time that faces need to be found, and hide the noise itself.
    """
    if target.mesh is not None or len(target.points) <= ENOUGH_POINTS:
        return target
    kept = np.random.default_rng(0).permutation(len(target.points))
    while len(kept) > ENOUGH_POINTS:
        scale = measure_scale(target.points[kept], np.random.default_rng(0))
        if scale.spacing >= scale.sigma:
            break
        kept = kept[: max(len(kept) // 2, ENOUGH_POINTS)]
    if len(kept) == len(target.points):
        return target
    return replace(target, points=target.points[kept], normals=None if target.normals is None else target.normals[kept])


def _corners(unit: Target, patches: list[Patch], sigma: float) -> np.ndarray:
    """Points [n, 3] whose box is the body's; strays of a noisy cloud, which lie on no surface, would widen it."""
    if unit.mesh is not None:
        return np.asarray(unit.mesh.vertices)
    return np.concatenate([p.points for p in patches]) if sigma > NOISY else unit.points


def _surfaces(unit: Target, rng: np.random.Generator, deadline: Deadline) -> tuple[list[Patch], list[Surface]]:
    """What the target shows, and for a cloud the planes that its faces only imply."""
    if unit.mesh is not None:
        return detect_patches(unit.mesh), []
    patches = detect_cloud(unit.points, unit.normals, rng, deadline=deadline)
    return patches, closing_planes(patches, measure_scale(unit.points, rng).spacing)


def _labeller(unit: Target, patches: list[Patch], deadline: Deadline) -> Callable[[np.ndarray], np.ndarray]:
    """The function that gives the probability of being inside [n] for points [n, 3]."""
    mesh = unit.mesh
    if mesh is not None:
        return lambda points: inside_mesh(mesh, points)
    from imdim.seeding.cloud_occupancy import inside_probability

    # single queries are right far more often than their votes are unanimous: a cell averages decisions, not doubts
    return lambda points: inside_probability(patches, unit.points, points, deadline=deadline) > 0.5
