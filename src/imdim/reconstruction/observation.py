"""The observation of one body: detected surfaces, the cells between them labelled inside or outside, and candidate families."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.detection.bulges import measure_bulges
from imdim.detection.cloud_sharpen import CloudBlend, sharpen_cloud
from imdim.detection.cloud_surfaces import detect_cloud
from imdim.detection.faceting import volume_between
from imdim.detection.implied_planes import closing_planes
from imdim.detection.mesh_noise import measure_mesh_noise
from imdim.detection.mesh_surfaces import detect_patches
from imdim.detection.noise import NoiseModel, measure_noise
from imdim.geometry import kernels
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.geometry.surface import Patch, Surface
from imdim.geometry.winding import Interior
from imdim.program.cost import CURVE, weigh
from imdim.program.patterns.weigh import weigh_once
from imdim.program.tree import Program
from imdim.reconstruction.evidence import ScoringSamples
from imdim.search.arrangement import ArrangementConfig, arrange
from imdim.search.candidate_families import Families
from imdim.search.cells import Cells, VolumeSamples, compress_samples, label_samples
from imdim.search.outline_families import NO_PLANES, PricedPlanes, find_planes
from imdim.target.target import InputError, Target

SAMPLES = 150_000  # labelled, spread over the cells
NOISY_SAMPLES = 40_000  # of a cloud whose noise blurs it: its cells only begin the search for the likeliest program
DOUBT = 8.0  # times the price of a feature in noise, whose samples are often on the wrong side of thin parts
SHARPENED = 3  # times that edges of a cloud are sharpened: faces come out that were blends' neighbours
BLUNT = 4e-3  # of the diagonal: the noise from which blends cost the search more than they show (benchmarks/results.md)
WAVES, LEAST_WAVES = 3.0, 1e-3  # times the noise of neighbours, and of the diagonal, from which a camera's cloud is off by waves
LEAST_WALL = 3e-4  # of a body's surface, that a wall of an outline shows
CLOSING_AREA = 1e-7  # of the squared diagonal; implied planes rank behind detected ones


class UnseenError(InputError):
    """A body shows no surface or no inside; `cut`: time had run out before all of it was looked at."""

    def __init__(self, message: str, cut: bool = False) -> None:
        super().__init__(message)
        self.cut = cut


@dataclass(frozen=True)
class UnitBody:
    """A body in its unit frame, its noise there, a mesh's `patches`; of a crowded cloud so many points that they show its faces, those
    `kept` [m] of all."""

    target: Target
    noise: NoiseModel
    patches: list[Patch] | None = None
    kept: np.ndarray | None = None

    @staticmethod
    def of(
        unit: Target, rng: np.random.Generator, patches: list[Patch] | None = None, detect_by: Deadline = NEVER, outlines: bool = True
    ) -> UnitBody:
        """A body that is in its unit frame, with its noise measured, and the `patches` of a mesh: those given, or those found until
        `detect_by` (by default all), elliptic cylinders if programs may have `outlines`."""
        if unit.mesh is not None:
            patches = detect_patches(unit.mesh, detect_by, elliptic=outlines) if patches is None else patches
            return UnitBody(unit, measure_mesh_noise(unit.mesh, patches), patches)
        noise, kept = measure_noise(unit.points, rng)
        if len(kept) < len(unit.points):
            unit = replace(unit, points=unit.points[kept], normals=None if unit.normals is None else unit.normals[kept])
        bulge = measure_bulges(unit.points) if unit.scanners is not None and len(unit.scanners) == 1 else 0.0
        if bulge > WAVES * max(noise.sigma, LEAST_WAVES * noise.diagonal):
            noise = replace(noise, sigma=bulge, bulges=True)
        return UnitBody(unit, noise, kept=kept)


@dataclass(frozen=True)
class Observation:
    """What detection and labelling know of one body, all in its unit frame, the programs that are asked about too.

    `noise` is a cloud's, corrected by what detection learned of it. `label` gives the probability of being inside [n] for points [n, 3].
    A primitive costs `size_weight` of the volume, a charged curve of an outline `curve` of that. `cut` says whether time ended the look at
    a cloud.
    """

    target: Target
    noise: NoiseModel
    patches: list[Patch]
    samples: VolumeSamples
    families: Families
    size_weight: float
    curve: float
    label: Callable[[np.ndarray], np.ndarray]
    cut: bool = False

    @cached_property
    def evidence(self) -> ScoringSamples:
        """What evolution and the front need to know."""
        mesh = self.target.mesh
        area = sum(p.area for p in self.patches) if mesh is None else float(mesh.area)
        surfaces = [p.surface for p in self.patches]
        return ScoringSamples(surfaces, self.families, self.samples, self.target.points, area, self.size_weight, mesh is not None)

    @property
    def noisy(self) -> bool:
        """Whether the noise of the body's cloud blurs its edges and walls, so that distances alone mislead."""
        return self.noise.blurs

    @property
    def cells(self) -> Cells:
        return self.families.cells

    @property
    def without_outlines(self) -> Observation:
        """The same samples, for a search among primitives alone."""
        return replace(self, families=Families(self.families.arrangement, self.cells))

    def error(self, program: Program) -> float:
        """Volume in which the body and a program differ over the samples, relative to the body's."""
        if program not in self._errors:
            samples = self.samples
            inside = kernels.inside(program, samples.points)
            self._errors[program] = float(np.where(inside, samples.w_out, samples.w_in).sum()) / self.cells.volume
        return self._errors[program]

    @cached_property
    def _errors(self) -> dict[Program, float]:
        """What `error` has told: each step of a run asks for the one before it."""
        return {}

    @cached_property
    def faceting(self) -> float:
        """Volume between a mesh and the curved surfaces that its facets stand for, relative to the body's: no fault of a program."""
        return 0.0 if self.target.mesh is None else volume_between(self.target.mesh, self.patches) / self.cells.volume

    def price(self, program: Program) -> float:
        """The search's objective, relative to the body's volume."""
        return self.error(program) + self._size_price(program)

    @cached_property
    def solid(self) -> Manifold | None:
        """The solid that the body's mesh bounds; None for a cloud, and for a mesh that bounds none."""
        return find_solid(self.target)

    def iou(self, program: Program) -> float | None:
        """Volume IoU of a program with the solid, by exact booleans; None where there is no solid."""
        if self.solid is None:
            return None
        if program not in self._ious:
            self._ious[program] = volume_iou(to_manifold(program), self.solid)
        return self._ious[program]

    @cached_property
    def _ious(self) -> dict[Program, float]:
        """What `iou` has told: a program is compared with one after the other."""
        return {}

    def exact_price(self, program: Program) -> float:
        """As `price`, with the exact volumes where there is a solid: samples may all have missed what a program gets wrong."""
        iou = self.iou(program)
        return self.price(program) if iou is None else 1 - iou + self._size_price(program)

    def _size_price(self, program: Program) -> float:
        return self.size_weight * (weigh_once if self.copies_once else weigh)(program, self.curve)

    @property
    def copies_once(self) -> bool:
        """Whether copies that repeat are paid for once, as curves are paid for; else primitives alone are counted."""
        return self.curve > 0


def find_solid(target: Target) -> Manifold | None:
    """The solid that a target's mesh bounds; None for a cloud, and for a mesh that bounds none."""
    try:
        return None if target.mesh is None else mesh_to_manifold(target.mesh)
    except ValueError:
        return None


def observe(
    body: UnitBody,
    size_weight: float,
    rng: np.random.Generator,
    detect_by: Deadline = NEVER,
    label_by: Deadline = NEVER,
    outlines: bool = False,
    curve: float = CURVE,
) -> Observation:
    """Surfaces, cells and candidate families of a body, with `outlines` those too, in which a charged curve costs `curve` of a primitive.

    Of a cloud, no more surfaces are looked for past `detect_by`, and no more samples are asked for their side past `label_by` (by default
    all are). Raises UnseenError.
    """
    patches, closing, noise = _surfaces(body, rng, detect_by)
    if outlines and body.target.mesh is None and noise.sigma < BLUNT * noise.diagonal:
        body, patches, closing = _sharpen(body, patches, closing, noise, rng, detect_by)
    unit = body.target
    cut = unit.mesh is None and detect_by.has_passed()
    if not patches:
        raise UnseenError(f"{unit.name}: no plane, sphere, cylinder, cone, torus or ellipsoid found in {len(unit.points)} points", cut)
    corners = _corners(unit, patches, noise)
    bounds = np.stack([np.min(corners, axis=0), np.max(corners, axis=0)])
    surfaces = [p.surface for p in patches] + closing
    areas = [p.area for p in patches] + [CLOSING_AREA] * len(closing)
    size_weight *= DOUBT if noise.blurs else 1.0
    arrangement = arrange(surfaces, areas, bounds, ArrangementConfig(least_wall=LEAST_WALL) if outlines else ArrangementConfig())
    label = _labeller(unit, patches, label_by)
    samples = label_samples(arrangement, label, NOISY_SAMPLES if noise.blurs else SAMPLES, rng)
    cut = cut or (unit.mesh is None and label_by.has_passed())
    cells = compress_samples(arrangement, samples)
    if not (cells.gain > 0).any():
        raise UnseenError(f"{unit.name}: no inside found, 0 of {len(cells.points)} sampled cells", cut)
    # what noise tilts would all lean
    exact = unit.mesh is not None and not noise.blurs
    planes = PricedPlanes(find_planes(arrangement, drafted=exact), curve * size_weight * cells.volume) if outlines else NO_PLANES
    families = Families(arrangement, cells, planes)
    return Observation(unit, noise, patches, samples, families, size_weight, curve, label, cut)


def _corners(unit: Target, patches: list[Patch], noise: NoiseModel) -> np.ndarray:
    """Points [n, 3] whose box is the body's; strays of a noisy cloud, which lie on no surface, would widen it."""
    if unit.mesh is not None:
        return np.asarray(unit.mesh.vertices)
    return np.concatenate([p.points for p in patches]) if noise.blurs else unit.points


def _surfaces(body: UnitBody, rng: np.random.Generator, deadline: Deadline) -> tuple[list[Patch], list[Surface], NoiseModel]:
    """What the target shows, for a cloud the planes that its faces only imply, and its noise."""
    unit = body.target
    if body.patches is not None:
        return body.patches, [], body.noise
    patches, noise = detect_cloud(unit.points, unit.normals, body.noise, rng, deadline=deadline)
    return patches, closing_planes(patches, noise.spacing), noise


def _sharpen(
    body: UnitBody, patches: list[Patch], closing: list[Surface], noise: NoiseModel, rng: np.random.Generator, deadline: Deadline
) -> tuple[UnitBody, list[Patch], list[Surface]]:
    """A cloud without the fillets and chamfers that its surfaces show, and its surfaces then, as far as there is time."""
    known: tuple[CloudBlend, ...] = ()
    for _ in range(SHARPENED):
        if deadline.has_passed():
            break
        sharp = sharpen_cloud(body.target.points, body.target.normals, patches, noise, known)
        if sharp is None:
            break
        body, known = replace(body, target=replace(body.target, points=sharp.points, normals=sharp.normals)), sharp.blends
        patches, closing, _ = _surfaces(body, rng, deadline)
    return body, patches, closing


def _labeller(unit: Target, patches: list[Patch], deadline: Deadline) -> Callable[[np.ndarray], np.ndarray]:
    """The function that gives the probability of being inside [n] for points [n, 3]."""
    mesh = unit.mesh
    if mesh is not None:
        return Interior(mesh).contains
    from imdim.detection.cloud_occupancy import inside_probability

    # single queries are right far more often than their votes are unanimous: a cell averages decisions, not doubts
    return lambda points: inside_probability(patches, unit.points, points, deadline=deadline) > 0.5
