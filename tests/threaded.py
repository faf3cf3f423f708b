"""Meshes of threaded parts, made with numpy: a thread's surface is one strip of facets wound about the z axis."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import trimesh
from manifold3d import Manifold

from imdim.geometry.solid import solid_of, to_trimesh

PITCH = 1.25  # of M8, whose depth is 5/8 of the sharp one in a nut, 17/24 in a bolt (ISO 68-1)
MINOR = {False: 8 - 2 * 17 / 24 * 0.8660254 * PITCH, True: 8 - 2 * 5 / 8 * 0.8660254 * PITCH}
SIDES = 32  # facets a turn


def threaded_rod(
    minor: float,
    major: float,
    pitch: float,
    length: float,
    sides: int = SIDES,
    starts: int = 1,
    flats: tuple[float, float] = (1 / 8, 1 / 4),
    rounded: bool = False,
) -> Manifold:
    """A right-handed rod from z = 0 to `length`: `flats` are those of crests and roots, shares of the pitch; a sine where `rounded`."""
    lead = starts * pitch
    at, radii = (
        np.array([flats[0] / 2, 0.5 - flats[1] / 2, 0.5 + flats[1] / 2, 1 - flats[0] / 2]),
        np.array([major, minor, minor, major]) / 2,
    )
    if rounded:
        at = np.arange(12) / 12
        radii = (minor + major) / 4 + (major - minor) / 4 * np.cos(2 * np.pi * at)
    once = np.concatenate([(at + j) / starts for j in range(starts)])
    turns = int(np.ceil(length / lead)) + 3
    heights, away = np.concatenate([once + turn for turn in range(turns)]), np.tile(radii, starts * turns)
    angles, rows = 2 * np.pi * np.arange(sides) / sides, len(heights)
    z = lead * (heights + np.arange(sides)[:, None] / sides - 1.5)
    corners = np.stack([away * np.cos(angles)[:, None], away * np.sin(angles)[:, None], z], -1).reshape(-1, 3)
    number, faces = np.arange(sides * rows).reshape(sides, rows), list[tuple[int, int, int]]()
    for i in range(sides):
        one, two = number[i], np.roll(number[(i + 1) % sides], -len(once) if i == sides - 1 else 0)
        for k in range(rows - 1 - (len(once) if i == sides - 1 else 0)):
            faces += [(one[k], two[k], two[k + 1]), (one[k], two[k + 1], one[k + 1])]
    low = [*number[:, 0], *number[0, len(once) : 0 : -1]]
    high = [*number[:, -1], *number[-1, rows - 2 : rows - 2 - len(once) : -1]]
    middles = [len(corners), len(corners) + 1]
    faces += [(b, a, middles[0]) for a, b in pairwise([*low, low[0]])] + [(a, b, middles[1]) for a, b in pairwise([*high, high[0]])]
    ends = [(0.0, 0.0, z.min() - 1), (0.0, 0.0, z.max() + 1)]
    whole = solid_of(np.vstack([corners, ends]), np.array(faces))
    return whole.trim_by_plane((0, 0, 1), 0).trim_by_plane((0, 0, -1), -length)


def ringed_rod(minor: float, major: float, pitch: float, length: float, half_angle_deg: float = 30.0) -> Manifold:
    """A rod with rings in place of a helix, as many programs draw a thread."""
    flank = (major - minor) / 2 * np.tan(np.radians(half_angle_deg))
    rod = Manifold.cylinder(length, minor / 2, minor / 2, 64)
    crest = (pitch / 2 - flank) / 2
    for k in range(int(length / pitch)):
        z = k * pitch
        for low, r1, r2, height in ((z, minor, major, flank), (z + flank, major, major, crest), (z + flank + crest, major, minor, flank)):
            rod += Manifold.cylinder(height, r1 / 2, r2 / 2, 64).translate((0, 0, low))
    return rod


def bolt(length: float = 16.0, chamfered: bool = False, **how: object) -> trimesh.Trimesh:
    """A screw M8 x 1.25 with a round head below z = 0."""
    rod = threaded_rod(MINOR[False], 8, PITCH, length, **how)  # type: ignore[arg-type]
    if chamfered:
        rod ^= Manifold.cylinder(length - 1, 5, 5, 64) + Manifold.cylinder(1, 4, 3, 64).translate((0, 0, length - 1))
    return to_trimesh(rod + Manifold.cylinder(5, 6.5, 6.5, 96).translate((0, 0, -5)))


def tapped_block(countersunk: bool = False) -> trimesh.Trimesh:
    """A block of 30 x 20 x 12 with a hole M8 x 1.25 through it, 5 beside its middle."""
    rod = threaded_rod(MINOR[True], 8, PITCH, 14, flats=(1 / 4, 1 / 8)).translate((5, 0, -7))
    if countersunk:
        rod += Manifold.cylinder(2, 3, 5, 64).translate((5, 0, 4.5))
    return to_trimesh(Manifold.cube((30, 20, 12), True) - rod)
