"""Relations that a designer meant: parallel, perpendicular, coaxial, flush, of equal radius, made exact where the points allow it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from imdim.detection.fit_ellipsoid import level_axes
from imdim.detection.fit_elliptic import turn_elliptic
from imdim.detection.fit_surface import MIN_POINTS, fit_surface
from imdim.geometry.sampling import subsample
from imdim.geometry.surface import AXISLESS, Patch, Surface, is_spindle, signed_distance, vec

_MAX_ANGLE_DEG = 4.0  # relations are looked for up to this angle; the points decide


def regularise(patches: list[Patch], tolerance: float) -> list[Patch]:
    """The patches in the same order on carriers with exact relations; carriers that become one are equal values.

    A carrier changes only if the root mean square distance of its patch's points then is at most sqrt(old^2 + tolerance^2);
    `tolerance` is in the points' units. Directions first (coordinate axes are preferred, then the directions of larger
    patches and those across them), then axes and centres, offsets of planes, semi-axes, radii. `outward` keeps its meaning.
    """
    work = [_Item(p, tolerance) for p in patches]
    firm = sorted(work, key=lambda item: -item.firmness)
    _align(firm)
    _share_axes(firm)
    _share(firm, ("sphere",), lambda item, head: _center_to(item, head.point))
    _share(firm, ("plane",), _to_plane)
    for item in firm:
        if item.surface.kind == "ellipsoid":
            item.take(level_axes(item.surface, 2 * tolerance))
    _share(firm, ("cylinder", "sphere"), _to_radius)
    return [item.patch() for item in work]


@dataclass
class _Item:
    """A patch while its carrier is being changed."""

    original: Patch
    tolerance: float

    def __post_init__(self) -> None:
        self.surface = self.original.surface
        points = np.asarray(self.original.points, float)
        self.points = subsample(points, 400)
        self.limit = math.hypot(self.rms(self.surface), self.tolerance)
        centered = self.points - self.points.mean(0)
        spread = np.sqrt(np.maximum(np.linalg.eigvalsh(centered.T @ centered / max(len(points), 1)), 0.0))
        # a plane turns about its long side, an axis about the patch's length
        self.firmness = float(spread[1] if self.surface.kind == "plane" else 0.5 * spread[2])

    @property
    def axis(self) -> np.ndarray:
        return np.asarray(self.surface.axis)

    @property
    def point(self) -> np.ndarray:
        return np.asarray(self.surface.point)

    def foot(self, point: np.ndarray) -> np.ndarray:
        """The nearest place on the axis."""
        return self.point + ((point - self.point) @ self.axis) * self.axis

    def rms(self, surface: Surface) -> float:
        return float(np.sqrt((signed_distance(surface, self.points) ** 2).mean()))

    def take(self, surface: Surface) -> bool:
        """Change to `surface` if the points allow it, and if it is one that a primitive can have."""
        if is_spindle(surface) or self.rms(surface) > self.limit:
            return False
        self.surface = surface
        return True

    def refit(self, start: Surface, hold: str) -> bool:
        if len(self.points) < MIN_POINTS[start.kind]:
            return self.take(start)
        return self.take(fit_surface(start.kind, self.points, start=start, hold=hold)[0])

    def patch(self) -> Patch:
        outward = self.original.outward
        if self.surface.kind == "plane" and np.dot(self.surface.axis, self.original.surface.axis) < 0:
            outward = -outward
        return replace(self.original, surface=self.surface, outward=outward)


def _align(firm: list[_Item]) -> None:
    known: list[np.ndarray] = [np.eye(3)[i] for i in (2, 1, 0)]
    for item in firm:
        if item.surface.kind in AXISLESS:
            continue
        turned = any(_turn(item, d) for d in _candidates(item.axis, known))
        if not turned or all(abs(item.axis @ d) < 1 - 1e-12 for d in known):
            known.append(item.axis)


def _candidates(axis: np.ndarray, known: list[np.ndarray]) -> Iterable[np.ndarray]:
    """Directions near `axis`: known ones, those across two known ones, and its own part across one known."""
    least = math.cos(math.radians(_MAX_ANGLE_DEG))
    across = (np.cross(a, b) for i, a in enumerate(known) for b in known[:i] if i > 2 and abs(a @ b) < 1e-9)
    yield from (d for d in chain(known, across) if abs(axis @ d) > least)
    for d in known:
        if abs(axis @ d) < math.sin(math.radians(_MAX_ANGLE_DEG)):
            flat = axis - (axis @ d) * d
            yield flat / np.linalg.norm(flat)


def _turn(item: _Item, direction: np.ndarray) -> bool:
    direction = direction if direction @ item.axis > 0 else -direction
    if abs(direction @ item.axis) > 1 - 1e-15:
        return True
    # turn about the patch, not about a far point of the carrier
    middle = item.points.mean(0)
    point = item.foot(middle) if item.surface.kind in ("cylinder", "elliptic") else item.point
    if item.surface.kind == "elliptic":
        return item.refit(replace(turn_elliptic(item.surface, direction), point=vec(point)), "axis")
    return item.refit(replace(item.surface, axis=vec(direction), point=vec(point)), "axis")


def _share_axes(firm: list[_Item]) -> None:
    """Axes of revolution that are parallel and near become one line; centres of spheres near a line move onto it."""
    heads = _share(firm, ("cylinder", "cone", "torus", "elliptic"), _onto_line)
    for item in firm:
        if item.surface.kind == "sphere":
            for head in heads:
                if _center_to(item, head.foot(item.point)):
                    break


def _share(firm: list[_Item], kinds: tuple[str, ...], joins: Callable[[_Item, _Item], bool]) -> list[_Item]:
    """Each item of some kinds joins the first of those before it that it can, or stays as it is; returned are the ones that stayed."""
    heads: list[_Item] = []
    for item in firm:
        if item.surface.kind in kinds and not any(joins(item, head) for head in heads):
            heads.append(item)
    return heads


def _onto_line(item: _Item, head: _Item) -> bool:
    if abs(head.axis @ item.axis) < 1 - 1e-12:
        return False
    foot = head.foot(item.point)
    if np.linalg.norm(item.point - foot) > 20 * item.limit:
        return False
    return item.refit(replace(item.surface, point=vec(foot)), "line")


def _center_to(item: _Item, center: np.ndarray) -> bool:
    if np.linalg.norm(center - item.point) > 20 * item.limit:
        return False
    radius = float(np.linalg.norm(item.points - center, axis=1).mean())
    return item.take(replace(item.surface, point=vec(center), sizes=(radius,)))


def _to_plane(item: _Item, head: _Item) -> bool:
    """Parallel planes at the same height become the firmest of them."""
    if abs(head.axis @ item.axis) < 1 - 1e-12:
        return False
    return bool(abs((item.point - head.point) @ head.axis) < 2 * item.tolerance) and item.take(head.surface)


def _to_radius(item: _Item, head: _Item) -> bool:
    near = head.surface.kind == item.surface.kind and abs(head.surface.sizes[0] - item.surface.sizes[0]) < item.tolerance
    return near and item.take(replace(item.surface, sizes=head.surface.sizes))
