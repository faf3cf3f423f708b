"""The noise of a bare cloud where no place of it is flat: one bent sheet of noisy points about each place, or the two skins of a thin wall.

Least quantiles of planes take a curve for noise, and both skins of a wall of a few deviations for one thick sheet. Here the neighbours of a
place are a mixture: one quadratic sheet, or two that run along one another, with the same noise, and a uniform density for what lies
elsewhere (Dempster, Laird & Rubin 1977).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from imdim.geometry.sampling import subsample

PLACES = 200
NEIGHBOURS = 64
TRIPLES = 120  # of neighbours, whose planes a place's sheet may begin with
STARTS = 5  # of them, the most crowded
ROUNDS = 15, 25  # of one sheet and of two
# where both of a wall begin, in deviations of the one sheet
SKINS = (-0.8, 0.8), (-1.3, 1.3), (-5.0, 0.0), (0.0, 5.0), (-9.0, 0.0), (0.0, 9.0)
APART = 2.5  # deviations between two skins at least; nearer ones look like one
CLEAR = 3.0  # nats by which two skins must tell a place better: three of four places on one sheet win less by chance
CALM = 0.25  # quantile of the places' deviations that counts
CALIBRATION = 0.9  # that quantile on a plane whose noise has the deviation 1
SEED = 0  # the same points always have the same noise
_LEAST = 1e-12


@dataclass(frozen=True)
class _Places:
    """Neighbours of places in frames of their own: monomials [m, k, 6] of where they lie along the sheet, `height` [m, k] over it, and
    the `span` [m] of all heights."""

    monomials: np.ndarray
    height: np.ndarray
    span: np.ndarray

    def take(self, chosen: np.ndarray) -> _Places:
        return _Places(self.monomials[chosen], self.height[chosen], self.span[chosen])


@dataclass(frozen=True)
class _Mixtures:
    """Of each place the coefficients [m, 6] of its sheet, the `offset` [m, j] of each skin from it and the `share` [m, j] of the
    neighbours that lie there, the deviation `sigma` [m] of the noise, and the logarithm of the `likelihood` [m]."""

    sheet: np.ndarray
    offset: np.ndarray
    share: np.ndarray
    sigma: np.ndarray
    likelihood: np.ndarray


def measure_sheets(points: np.ndarray, sigma: float) -> float:
    """Deviation of the noise of `points` [n, 3], for which `sigma` is a first guess.

    Both skins of thin walls count only where most places show them.
    """
    if len(points) < NEIGHBOURS:
        return sigma
    places = _places_around(points, sigma)
    one = _fit(places, _single(places, sigma), ROUNDS[0])
    best = one.likelihood.reshape(-1, STARTS).argmax(1) + np.arange(len(one.sigma) // STARTS) * STARTS
    places, one = places.take(best), _take(one, best)
    two = [_fit(places, _split(one, skins), ROUNDS[1]) for skins in SKINS]
    likelihood = np.array([t.likelihood for t in two])
    won = likelihood.max(0) - one.likelihood
    thin = np.choose(likelihood.argmax(0), [t.sigma for t in two])
    walls = bool(np.median(won) > CLEAR)
    return float(np.quantile(np.where(walls & (won > CLEAR), thin, one.sigma), CALM)) / CALIBRATION


def _places_around(points: np.ndarray, sigma: float) -> _Places:
    """STARTS sheets for each of PLACES points: planes through three neighbours that most of the others crowd at."""
    middle = subsample(points, PLACES)
    reach, near = KDTree(points).query(middle, k=NEIGHBOURS)
    own = points[near] - middle[:, None]
    normal, at = _crowded_planes(own, sigma)
    own, reach = np.repeat(own, STARTS, axis=0), np.repeat(reach[:, -1:], STARTS, axis=0)
    beside = np.where(np.abs(normal[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    u = np.cross(normal, beside)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    height, x, y = (np.einsum("mkc,mc->mk", own, axis) for axis in (normal, u, np.cross(normal, u)))
    height, x, y = height - at[:, None], x / reach, y / reach
    return _Places(np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], -1), height, np.ptp(height, axis=1) + 4 * sigma)


def _crowded_planes(own: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Normals [m STARTS, 3] and distances from the origin [m STARTS] of planes through three of the neighbours `own` [m, k, 3]."""
    rng = np.random.default_rng(SEED)
    triples = np.array([rng.choice(own.shape[1], 3, replace=False) for _ in range(TRIPLES)])
    a, b, c = own[:, triples].transpose(2, 0, 1, 3)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=-1)
    normal = np.where(length[..., None] > 0, normal / np.maximum(length, 1e-300)[..., None], [0.0, 0.0, 1.0])
    at = (normal * a).sum(-1)
    crowd = np.exp(-0.5 * ((normal @ own.transpose(0, 2, 1) - at[..., None]) / sigma) ** 2).sum(-1)
    # what lies nearly in a row has no normal
    crowd[length < 0.2 * np.maximum(((b - a) ** 2).sum(-1), ((c - a) ** 2).sum(-1))] = -1.0
    best = np.argsort(-crowd, axis=1, kind="stable")[:, :STARTS]
    rows = np.arange(len(own))[:, None]
    return normal[rows, best].reshape(-1, 3), at[rows, best].ravel()


def _single(places: _Places, sigma: float) -> _Mixtures:
    m = len(places.span)
    return _Mixtures(np.zeros((m, 6)), np.zeros((m, 1)), np.full((m, 1), 0.6), np.full(m, sigma), np.full(m, -np.inf))


def _split(one: _Mixtures, skins: tuple[float, float]) -> _Mixtures:
    """Two skins to start with in the place of a sheet."""
    offset = np.outer(one.sigma, skins)
    return replace(one, offset=offset, share=np.full(offset.shape, 0.45), sigma=0.55 * one.sigma)


def _take(found: _Mixtures, chosen: np.ndarray) -> _Mixtures:
    arrays = found.sheet, found.offset, found.share, found.sigma, found.likelihood
    return _Mixtures(*(a[chosen] for a in arrays))


def _fit(places: _Places, start: _Mixtures, rounds: int) -> _Mixtures:
    found = start
    for _ in range(rounds):
        held, likelihood = _responsibilities(places, found)
        found = replace(_maximise(places, held, found), likelihood=likelihood)
    return found


def _responsibilities(places: _Places, found: _Mixtures) -> tuple[np.ndarray, np.ndarray]:
    """What each skin answers for of each neighbour [m, j, k], and the logarithms of the likelihoods [m] of the places."""
    away, sigma = _distances(places, found.sheet, found.offset), found.sigma[:, None, None]
    density = found.share[..., None] * np.exp(-0.5 * (away / sigma) ** 2) / (np.sqrt(2 * np.pi) * sigma)
    whole = density.sum(1) + (np.clip(1 - found.share.sum(1), 2e-3, None) / places.span)[:, None]
    return density / whole[:, None], np.log(whole).sum(1)


def _maximise(places: _Places, held: np.ndarray, found: _Mixtures) -> _Mixtures:
    mass = held.sum(2)
    sheet = _fit_sheets(places, held, found.offset)
    offset = found.offset if mass.shape[1] == 1 else _part(places, held, sheet, found.sigma)
    square = (held * _distances(places, sheet, offset) ** 2).sum((1, 2))
    free = np.maximum(mass.sum(1) - 5 - mass.shape[1], 1.0)  # of numbers that are fitted
    sigma = np.sqrt(np.maximum(square / free, 1e-3 * _LEAST * places.span**2))
    share = mass / held.shape[2]
    share /= np.maximum(share.sum(1, keepdims=True) / 0.995, 1.0)
    return replace(found, sheet=sheet, offset=offset, share=share, sigma=sigma)


def _fit_sheets(places: _Places, held: np.ndarray, offset: np.ndarray) -> np.ndarray:
    weight = held.sum(1)
    height = (held * (places.height[:, None] - offset[..., None])).sum(1)
    weighed = (places.monomials * weight[..., None]).transpose(0, 2, 1)
    slope = (places.monomials.transpose(0, 2, 1) @ height[..., None])[..., 0]
    return np.linalg.solve(weighed @ places.monomials + 1e-6 * np.eye(6), slope[..., None])[..., 0]


def _part(places: _Places, held: np.ndarray, sheet: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Offsets [m, 2] of two skins, at least APART from one another about where they are."""
    mass = held.sum(2)
    offset = (held * _distances(places, sheet, np.zeros((len(sheet), 1)))).sum(2) / np.maximum(mass, _LEAST)
    share = mass / np.maximum(mass.sum(1, keepdims=True), _LEAST)
    apart = np.maximum(offset[:, 1] - offset[:, 0], APART * sigma)
    return (share * offset).sum(1)[:, None] + apart[:, None] * np.stack([-share[:, 1], share[:, 0]], 1)


def _distances(places: _Places, sheet: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Of the neighbours from each skin [m, j, k]."""
    base = np.einsum("mkp,mp->mk", places.monomials, sheet)
    return (places.height - base)[:, None] - offset[..., None]
