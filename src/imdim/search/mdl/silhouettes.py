"""Primitives that show in a noisy cloud along the part's main directions: walls in its silhouettes, faces in its profiles about an axis.

Seen along a direction of the part, the points of a wall fall onto its outline, and those of all other faces are strewn evenly: circles of
the outline have contrast (`curve_ransac`). So have flat faces among the distances along one direction, and cones in the half plane about an
axis. Hypotheses come from random points (Fischler & Bolles 1981).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry.rotations import frame_from_axis
from imdim.geometry.rows import lengths
from imdim.geometry.sampling import subsample
from imdim.program.tree import Primitive
from imdim.search.mdl.candidates.drawn import trace_extruded_outlines, trace_turned_outlines
from imdim.search.mdl.candidates.residual import place
from imdim.search.mdl.curve_ransac import (
    BAND,
    FILLED,
    LEAST,
    SURE,
    best_curve,
    circles,
    crowding,
    draw_triples,
    find_filled_stretch,
    fit_circle,
    fit_line,
    lines,
    sure,
)

MOST = 10  # circles of a shadow, and flat faces across a direction
MOST_CURVES = 32  # of a shadow, straight ones included
TRIALS = 3000
GLIMPSE = 2.5  # standard errors below which nothing is left to be fitted
SAGITTA = 4.0  # deviations of the noise by which an arc must leave its chord, and a slant both its axes
APART = 4.0  # deviations of the noise by which ends lie off the levels that are seen
SECTORS = 36
SCORED = 4000  # points that judge hypotheses
SAME = 0.5  # overlap of two flat faces that may be those of one box
MOST_LINES = 6
OUTERMOST = (0.02, 0.98)  # quantiles of coordinates, beyond which points may be strays


class ShownPrimitives(NamedTuple):
    """The `primitives` that points show, and whether time has `cut` the look for them."""

    primitives: list[Primitive]
    cut: bool


@dataclass(frozen=True)
class _View:
    """Points in the part's directions; direction k is looked along, u and v lie across."""

    local: np.ndarray
    axes: np.ndarray
    k: int
    sigma: float

    @property
    def across(self) -> tuple[int, int]:
        return (self.k + 1) % 3, (self.k + 2) % 3

    def place(self, kind: str, size: Iterable[float], center: np.ndarray) -> Primitive:
        return place(kind, size, center, self.axes, self.axes if kind == "box" else frame_from_axis(self.axes[:, self.k]))

    def middle(self, center: np.ndarray, height: float) -> np.ndarray:
        out = np.zeros(3)
        out[list(self.across)], out[self.k] = center, height
        return out


def outlines(
    points: np.ndarray, axes: np.ndarray, sigma: float, seed: int = 0, deadline: Deadline = NEVER, drawn: bool = False
) -> ShownPrimitives:
    """Cylinders, cones and boxes for `points` [n, 3] with noise of deviation `sigma`, if `drawn` solids of outlines too; some may be wrong.

    `axes` [3, 3] has the part's directions as columns. Past the `deadline` (by default never) nothing more is looked for; each
    direction has a third of the time.
    """
    rng = np.random.default_rng(seed)
    local = np.ascontiguousarray(points @ axes)
    out, cut = list[Primitive](), False
    for k in range(3):
        if deadline.has_passed():
            return ShownPrimitives(out, True)
        axis_by = deadline.ahead(deadline.left() / (3 - k))
        view = _View(local, axes, k, sigma)
        out += _boxes(view)
        found: list[np.ndarray] = []
        for center, radius in _circles(view, rng, axis_by):
            ends = _ends(view, center, radius)
            if ends is not None:
                out.append(view.place("cylinder", (radius, ends[1] - ends[0]), view.middle(center, sum(ends) / 2)))
                found.append(center)
        # a cone casts no circle
        middle = np.quantile(local[:, view.across], OUTERMOST, axis=0).mean(0)
        centers = _apart([*_apart(found, 2 * sigma)[:MOST_LINES], middle], 2 * sigma)
        for center in centers:
            out += [] if axis_by.has_passed() else _profile(view, center, rng)
        if drawn and not axis_by.has_passed():
            out += trace_turned_outlines(points, axes, k, centers, sigma)
            out += trace_extruded_outlines(points, axes, k, _with_ends(_levels(local[:, k], sigma), local[:, k], sigma), sigma, axis_by)
        cut |= axis_by.has_passed()
    return ShownPrimitives(out, cut)


def _apart(centers: list[np.ndarray], least: float) -> list[np.ndarray]:
    out: list[np.ndarray] = []
    for center in centers:
        if all(np.linalg.norm(center - o) > least for o in out):
            out.append(center)
    return out


def _circles(view: _View, rng: np.random.Generator, deadline: Deadline) -> list[tuple[np.ndarray, float]]:
    """Centres and radii of the circles of a shadow, the clearest first. What a straight wall explains as well is none."""
    shadow = np.ascontiguousarray(view.local[:, view.across])
    weight, width = crowding(shadow, view.sigma), BAND * view.sigma
    free = np.ones(len(shadow), bool)
    largest = 0.6 * float(np.linalg.norm(np.ptp(shadow, axis=0)))
    out = []
    for _ in range(MOST_CURVES):
        if (weight * free > 0).sum() < LEAST or len(out) == MOST or deadline.has_passed():
            break
        picks, scored = draw_triples(shadow, weight * free, TRIALS, rng), subsample(shadow[free], SCORED)
        x, y, r, round_contrast = best_curve(circles, shadow, picks, scored, width, largest)
        *ends, straight_contrast = best_curve(lines, shadow, picks[: TRIALS // 2, :2].copy(), scored, width)
        if max(round_contrast, straight_contrast) < GLIMPSE:
            break
        circle = fit_circle(shadow, (x, y), r, view.sigma) if round_contrast > straight_contrast else None
        if circle is None:
            free &= ~_beside_line(shadow, np.reshape(ends, (2, 2)), 2 * width)
            continue
        center, radius = circle
        away = np.abs(lengths(shadow - center) - radius)
        inner, outer = away < width, (away >= width) & (away < 2 * width)
        free &= ~(inner | outer)
        if sure(inner, outer) and _bends(shadow[inner] - center, shadow[outer] - center, radius, view.sigma):
            out.append((center, radius))
    return out


def _beside_line(shadow: np.ndarray, ends: np.ndarray, width: float) -> np.ndarray:
    """Mask [n] of the points within `width` of the stretch between two `ends` [2, 2]."""
    length = float(np.linalg.norm(ends[1] - ends[0]))
    along = (ends[1] - ends[0]) / max(length, 1e-300)
    place = (shadow - ends[0]) @ along
    return (np.abs((shadow - ends[0]) @ np.array([-along[1], along[0]])) < width) & (place > 0) & (place < length)


def _bends(inner: np.ndarray, outer: np.ndarray, radius: float, sigma: float) -> bool:
    """Whether the arc that the points [n, 2] of two bands about a centre show is more than a line."""
    counts = [np.histogram(np.arctan2(arm[:, 1], arm[:, 0]), bins=SECTORS, range=(-np.pi, np.pi))[0] for arm in (inner, outer)]
    more = counts[0] - counts[1]
    filled = more > FILLED * np.median(more[more > 0])
    span = filled.sum() / SECTORS * 2 * np.pi
    return bool(radius * (1 - np.cos(min(span / 2, np.pi))) > SAGITTA * sigma)


def _ends(view: _View, center: np.ndarray, radius: float) -> tuple[float, float] | None:
    """Where a cylinder's wall begins and ends."""
    away = np.abs(lengths(view.local[:, view.across] - center) - radius)
    height = view.local[:, view.k]
    width = BAND * view.sigma
    return find_filled_stretch(height[away < width], height[(away >= width) & (away < 2 * width)], view.sigma)


def _profile(view: _View, center: np.ndarray, rng: np.random.Generator) -> list[Primitive]:
    """Cones and cylinders about an axis: lines of the half plane of distances from the axis and heights."""
    profile = np.column_stack([lengths(view.local[:, view.across] - center), view.local[:, view.k]])
    weight, free = crowding(profile, view.sigma), np.ones(len(profile), bool)
    out: list[Primitive] = []
    for _ in range(MOST):
        if (weight * free > 0).sum() < LEAST:
            break
        picks = draw_triples(profile, weight * free, TRIALS // 2, rng)
        *ends, contrast = best_curve(lines, profile, picks[:, :2].copy(), subsample(profile[free], SCORED), BAND * view.sigma)
        if contrast < GLIMPSE:
            break
        origin, normal = fit_line(profile, np.reshape(ends, (2, 2)), view.sigma)
        off = (profile - origin) @ normal
        along = (profile - origin) @ np.array([-normal[1], normal[0]])
        width = BAND * view.sigma
        inner, outer = np.abs(off) < width, (np.abs(off) >= width) & (np.abs(off) < 2 * width)
        free &= np.abs(off) >= 2 * width
        stretch = find_filled_stretch(along[inner], along[outer], view.sigma)
        if stretch is None or not sure(inner, outer):
            continue
        corners = origin + np.array(stretch)[:, None] * np.array([-normal[1], normal[0]])
        solid = _revolve_segment(view, center, corners)
        out += [solid] if solid else []
    return out


def _revolve_segment(view: _View, center: np.ndarray, corners: np.ndarray) -> Primitive | None:
    """The cone or cylinder below a segment of the profile with ends `corners` [2, 2]; None for flat faces."""
    (r0, h0), (r1, h1) = corners[np.argsort(corners[:, 1])]
    if h1 - h0 < SAGITTA * view.sigma:
        return None
    r0, r1 = (0.0 if r < 2 * view.sigma else float(r) for r in (r0, r1))
    middle = view.middle(center, (h0 + h1) / 2)
    if abs(r1 - r0) < SAGITTA * view.sigma:
        return view.place("cylinder", ((r0 + r1) / 2, h1 - h0), middle) if r0 + r1 > 0 else None
    return view.place("cone", (r0, r1, h1 - h0), middle)


def _boxes(view: _View) -> list[Primitive]:
    """Boxes between two flat faces across the direction that lie over one another."""
    height = view.local[:, view.k]
    # with the low and high corners [2, 2] of their points
    on = {t: view.local[np.abs(height - t) < BAND * view.sigma][:, view.across] for t in _levels(height, view.sigma)}
    faces = [(t, np.quantile(points, (0.01, 0.99), axis=0)) for t, points in on.items()]
    out = []
    for i, (bottom, a) in enumerate(faces):
        for top, b in faces[i + 1 :]:
            overlap = np.prod(np.maximum(np.minimum(a[1], b[1]) - np.maximum(a[0], b[0]), 0.0))
            low, high = np.minimum(a[0], b[0]), np.maximum(a[1], b[1])
            if overlap < SAME * np.prod(high - low):
                continue
            size = np.zeros(3)
            size[list(view.across)], size[view.k] = high - low, top - bottom
            out.append(view.place("box", size, view.middle((low + high) / 2, (bottom + top) / 2)))
    return out


def _with_ends(levels: list[float], height: np.ndarray, sigma: float) -> list[float]:
    """The levels and where the points end: of a long tube the ends have few points."""
    ends = (float(end) for end in np.quantile(height, OUTERMOST))
    return sorted([*levels, *(end for end in ends if all(abs(end - level) > APART * sigma for level in levels))])


def _levels(height: np.ndarray, sigma: float) -> list[float]:
    """Heights at which more points lie than beside, at most MOST, in their order."""
    ordered = np.sort(height)
    grid = np.arange(ordered[0], ordered[-1] + sigma / 2, sigma / 2)
    width = BAND * sigma

    def within(reach: float) -> np.ndarray:
        return np.searchsorted(ordered, grid + reach) - np.searchsorted(ordered, grid - reach)

    inner, both = within(width), within(2 * width)
    contrast = 2 * inner - both
    sure = contrast > np.maximum(SURE * np.sqrt(both), LEAST)
    chosen: list[float] = []
    for i in np.argsort(-contrast, kind="stable"):
        if not sure[i] or len(chosen) == MOST:
            break
        if all(abs(grid[i] - t) > 2.5 * sigma for t in chosen):
            chosen.append(float(grid[i]))
    return sorted(chosen)
