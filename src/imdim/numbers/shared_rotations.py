"""Leaves that share directions: one rotation for all of them, so that what was found parallel stays parallel while its numbers move."""

from __future__ import annotations

import numpy as np

from imdim.geometry.axes import SYMMETRIES
from imdim.geometry.lowering import Lowered
from imdim.geometry.rotations import frame_from_axis, skew
from imdim.program.tree import KINDS

BOX, SPHERE, ELLIPSOID, EXTRUDE = (KINDS.index(kind) for kind in ("box", "sphere", "ellipsoid", "extrude"))
FULL = (BOX, ELLIPSOID, EXTRUDE)  # kinds with three directions; a sphere has none, the others have their axis
TURNS = 6  # first of the rotation's coordinates of a leaf


def frames(numbers: Lowered, most_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """The frame int [k] that each leaf belongs to, -1 for spheres, and the frames' directions [f, 3, 3] as columns.

    Boxes found first lead; a leaf joins the first frame of which it is no further than `most_deg` away, up to exchanged axes.
    """
    member = np.full(len(numbers.kinds), -1)
    found: list[np.ndarray] = []
    kinds = numbers.kinds.tolist()
    for i in sorted(range(len(kinds)), key=lambda i: kinds[i] not in FULL):
        if kinds[i] == SPHERE:
            continue
        angles = [_angle(kinds[i], numbers.rotations[i], f) for f in found]
        member[i] = next((g for g, a in enumerate(angles) if a <= most_deg), len(found))
        if member[i] == len(found):
            found.append(numbers.rotations[i] if kinds[i] in FULL else frame_from_axis(numbers.rotations[i][:, 2]))
    return member, np.array(found).reshape(-1, 3, 3)


def align_rotations(numbers: Lowered, most_deg: float) -> np.ndarray:
    """Rotations [k, 3, 3] of the leaves turned exactly into the directions of their frames."""
    member, directions = frames(numbers, most_deg)
    out = numbers.rotations.copy()
    for i, g in enumerate(member):
        if g >= 0:
            out[i] = _nearest(numbers.kinds[i], numbers.rotations[i], directions[g])
    return out


def map_shared_turns(numbers: Lowered, member: np.ndarray) -> np.ndarray:
    """Matrices [k, 9, 3] from the rotation vector of a leaf's frame about the centroid of its leaves to the kernels' (sizes, shift,
    rotation vector) of the leaf; zero for a sphere."""
    out = np.zeros((len(member), 9, 3))
    for g in range(int(member.max(initial=-1)) + 1):
        own = np.flatnonzero(member == g)
        across = skew(numbers.centers[own].mean(0) - numbers.centers[own])  # w -> w x arm
        back = numbers.rotations[own].transpose(0, 2, 1)
        out[own, 3:6], out[own, 6:9] = back @ across, back
    return out


def _angle(kind: int, rotation: np.ndarray, frame: np.ndarray) -> float:
    """Degrees from a leaf's directions to the nearest of a frame."""
    if kind in FULL:
        cosine = (float((_nearest(kind, rotation, frame) * rotation).sum()) - 1) / 2
    else:
        cosine = float(np.abs(rotation[:, 2] @ frame).max())
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _nearest(kind: int, rotation: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """The rotation along a frame's directions that is nearest; a leaf with one axis keeps its spin."""
    if kind in FULL:
        return max((frame @ s for s in SYMMETRIES), key=lambda f: float((f * rotation).sum()))
    along = rotation[:, 2] @ frame
    axis = frame[:, int(np.abs(along).argmax())] * np.sign(along[int(np.abs(along).argmax())])
    side = rotation[:, 0] - (rotation[:, 0] @ axis) * axis
    side /= np.linalg.norm(side)
    return np.column_stack([side, np.cross(axis, side), axis])
