"""Whether a program explains a cloud, judged without the true solid.

Distances see one side of every surface: a thin cloud lies near a wrong solid, and near a skin of any thickness. Three things tell. A smooth
sheet through most of the points, which knows nothing of solids, tells the points that were kept from it; a program that tells them worse
has found out nothing (cross-validated likelihood; the sheet is a manifold Parzen estimate, Vincent & Bengio 2003). Surface that no point is
near may be air. And of a wall thinner than the noise only the middle is seen, not how thick it is, nor whether it is one.

A scanned mesh has its inside, but a real thing leaves what was drawn, by so much and no more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from imdim.detection.noise import NoiseModel
from imdim.geometry import kernels
from imdim.geometry.sampling import EIGHTH, surface_spacing
from imdim.geometry.shadows import Shadows
from imdim.numbers.likelihood import GAP, Noise, SurfaceSamples, expectation_step
from imdim.program.tree import Program

MOST_POINTS = 8192  # that are asked
FEWEST = 400  # points that can be asked
FOLDS = 5  # of the points, each told by a sheet through the others
NEIGHBOURS = 24  # of a point, through which its plane is laid
AROUND = 6  # places of a surface next to a point
PLANE_ROUNDS, NOISE_ROUNDS = 2, 4
STRAY = 3.0  # deviations of the noise off its neighbours' plane, from which a point is none of the sheet's
ALONG = 0.5  # least cosine between the normals of two surfaces of which one stands for the other
LEAST_NOISE = 1e-3  # of the diagonal: chords of a result and planes through few points lie off a curve, in a calm cloud too
EXPECTED = 8.0  # points where a place of the surface counts as bare if it has none: one in three thousand would by chance
THINNER = 2.0  # spacings over the cloud's median, up to which sparse places are taken for sparse rather than bare


@dataclass(frozen=True, eq=False)
class Explanation:
    """How a program explains a cloud, shares of 1 of the program's own surface.

    `gain` and `shown_gain`: nats per point by which the program tells the points better than a sheet through their neighbours, by its whole
    surface and by what points are near; None where the noise bulges, which neighbours tell of one another and no program should. `bare`:
    surface that no point is near; `blurred`: surface of walls thinner than the noise. Places of the surface `at` [m, 3] are in such a wall
    where `thin` [m]. Per point asked, `points` [n, 3], `losses` [n] are what the sheet tells it better by. `unseen` is the share of the
    whole surface that no known scanner could see; the others are of the rest.
    """

    gain: float | None
    shown_gain: float | None
    bare: float
    blurred: float
    at: np.ndarray
    thin: np.ndarray
    points: np.ndarray
    losses: np.ndarray
    unseen: float = 0.0

    @property
    def is_worse(self) -> bool:
        """Whether the sheet tells the points better than the program does."""
        return self.gain is not None and self.gain < 0

    @property
    def is_shown_worse(self) -> bool:
        """Whether it does better than what of the program's surface points are near."""
        return self.shown_gain is not None and self.shown_gain < 0

    def is_blurred(self, points: np.ndarray) -> np.ndarray:
        """Whether most of the program's surface next to each of `points` [n, 3] is in a wall thinner than the noise; the tip of a wedge is
        not."""
        near = np.asarray(KDTree(self.at).query(points, k=min(AROUND, len(self.at)))[1])
        return self.thin[near].reshape(len(points), -1).mean(1) > 0.5

    def is_explained_worse(self, points: np.ndarray) -> np.ndarray:
        """Whether the sheet tells the cloud around each of `points` [n, 3] better than the program does."""
        near = np.asarray(KDTree(self.points).query(points, k=NEIGHBOURS)[1])
        return self.losses[near].mean(1) > 0


def explain(program: Program, points: np.ndarray, model: NoiseModel, scanners: np.ndarray | None = None) -> Explanation | None:
    """How `program` explains a cloud of `points` [n, 3] in its units, whose noise is as in the `model`, as `scanners` [k, 3] saw it if they
    are known; None where the program has no surface that they could see, and for fewer than FEWEST points."""
    points = points[np.random.default_rng(0).permutation(len(points))[:MOST_POINTS]]
    least = LEAST_NOISE * float(np.linalg.norm(np.ptp(points, axis=0)))
    shadows = None if scanners is None else Shadows.of(points, scanners, model.sigma)
    start = Noise(max(model.sigma, least), least=least, shadows=shadows)
    shown, noise = SurfaceSamples.of(program, start.sigma, shadows=shadows), start
    if len(points) < FEWEST or not len(shown.points):
        return None
    for _ in range(NOISE_ROUNDS):
        noise = expectation_step(points, shown, noise).noise
        shown = SurfaceSamples.of(program, noise.sigma, shadows=shadows)
    bare = is_bare(shown.points, points[np.abs(kernels.program_sdf(program, points)) <= STRAY * noise.sigma], noise)
    part = replace(shown, points=shown.points[~bare], normals=shown.normals[~bare], area=shown.area * float(np.mean(~bare)))
    thin = ~kernels.inside(program, shown.points - GAP * noise.sigma * shown.normals)
    unseen = 0.0 if shadows is None else max(1 - shown.area / SurfaceSamples.of(program, noise.sigma).area, 0.0)
    found = Explanation(None, None, float(bare.mean()), float(thin.mean()), shown.points, thin, points, np.zeros(len(points)), unseen)
    if model.bulges:
        return found
    sheet = _tell_by_neighbours(points, start)
    whole, seen = (expectation_step(points, s, noise).logs for s in (shown, part))
    gain, shown_gain = (float(np.mean(logs - sheet)) for logs in (whole, seen))
    return replace(found, gain=gain, shown_gain=shown_gain, losses=sheet - whole)


def share_borne_out(
    program: Program, points: np.ndarray, normals: np.ndarray, areas: np.ndarray, deviation: float, oriented: bool = True
) -> float:
    """Share by `areas` [n] of a scanned surface, places `points` and `normals` [n, 3], outward if they are `oriented`, that runs along the
    surface of `program`, no farther off than real things leave it; they do by `deviation`, in units of the points."""
    ahead, at, behind = (kernels.program_sdf(program, points + by * normals) for by in (deviation / 4, 0.0, -deviation / 4))
    slope = (ahead - behind) / (deviation / 2)
    along = (slope if oriented else np.abs(slope)) > ALONG
    return float(areas[along & (np.abs(at) <= STRAY * deviation)].sum() / areas.sum())


def is_bare(places: np.ndarray, points: np.ndarray, noise: Noise) -> np.ndarray:
    """Which `places` [m, 3] of a surface none of its `points` [n, 3] is near, by how dense they are around the nearest one."""
    if len(points) <= EIGHTH:
        return np.ones(len(places), bool)
    tree = KDTree(points)
    eighth = np.asarray(tree.query(points, k=EIGHTH + 1)[0])[:, -1]
    spacing = np.minimum(eighth, THINNER * np.median(eighth)) * math.sqrt(math.pi / EIGHTH)
    far, nearest = tree.query(places)
    return far > np.hypot(math.sqrt(EXPECTED / math.pi) * spacing[nearest], GAP * noise.sigma)


def _tell_by_neighbours(points: np.ndarray, noise: Noise) -> np.ndarray:
    """The logarithms [n] of the points' densities, each by a smooth sheet through the points of the other folds."""
    fold, logs = np.arange(len(points)) % FOLDS, np.empty(len(points))
    for number in range(FOLDS):
        asked = fold == number
        sheet, own = _smooth(points[~asked], noise.sigma), noise
        for _ in range(NOISE_ROUNDS):
            own = expectation_step(points[asked], sheet, own).noise
        logs[asked] = expectation_step(points[asked], sheet, own).logs
    return logs


def _smooth(points: np.ndarray, sigma: float) -> SurfaceSamples:
    """Points [n, 3] moved onto planes through their neighbours, without the strays."""
    far, near = KDTree(points).query(points, k=min(NEIGHBOURS, len(points) - 1) + 1)
    around = points[near]
    close = np.exp(-2 * (far / np.maximum(far[:, -1:], 1e-300)) ** 2)
    weight = close
    for _ in range(PLANE_ROUNDS):
        center = (weight[..., None] * around).sum(1) / weight.sum(1, keepdims=True)
        arms = around - center[:, None]
        normal = np.linalg.eigh(np.einsum("nk,nki,nkj->nij", weight, arms, arms))[1][:, :, 0]
        weight = close / (1 + (np.einsum("nki,ni->nk", arms, normal) / (2 * sigma)) ** 2) ** 2
    off = ((points - center) * normal).sum(1)
    kept = np.abs(off) <= STRAY * sigma
    spacing = surface_spacing(far[:, min(EIGHTH, far.shape[1] - 1)])
    return SurfaceSamples((points - off[:, None] * normal)[kept], normal[kept], float(kept.sum()) * spacing**2, 0.0)
