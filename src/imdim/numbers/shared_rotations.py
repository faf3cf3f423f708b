"""Leaves that share directions: one rotation for all of them, so that what was found parallel stays parallel while its numbers move."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from imdim.geometry.axes import SYMMETRIES
from imdim.geometry.lowering import Lowered, lower
from imdim.geometry.rotations import frame_from_axis, matrix_from_euler, shortest_turn, skew
from imdim.numbers.symmetry_normal_form import along_axis, in_frame, is_round, round_turns
from imdim.program.tree import KINDS, Primitive, combine_all

BOX, SPHERE, ELLIPSOID, EXTRUDE, DRAFTED = (KINDS.index(kind) for kind in ("box", "sphere", "ellipsoid", "extrude", "drafted"))
FULL = (BOX, ELLIPSOID, EXTRUDE, DRAFTED)  # kinds with three directions; a sphere has none, the others have their axis
EQUAL = np.array(SYMMETRIES)
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


def swing_centers(numbers: Lowered, shift: np.ndarray, member: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """The centres [k, 3] after a `shift` [k, 3], in the frames as they are, and turns of these by rotation vectors [f, 3] about the
    centroids of their leaves. `map_shared_turns` goes along tangents, where coordinates that were equal would not be so in a turned
    frame."""
    out = numbers.centers + shift
    for g, vector in enumerate(turns):
        own = np.flatnonzero(member == g)
        middle, across = numbers.centers[own].mean(0), skew(vector)
        angle = max(float(np.linalg.norm(vector)), 1e-12)
        turn = np.eye(3) + np.sin(angle) / angle * across + (1 - np.cos(angle)) / angle**2 * across @ across
        out[own] = middle + (out[own] - middle) @ turn.T
    return out


def round_together(parts: Sequence[Primitive], same_deg: float, max_deg: float) -> list[list[Mapping[int, Primitive]]]:
    """For leaves that share directions within `same_deg` the rounder rotations that they may take together, the roundest first: a plate and
    the holes in it stay square to each other. No leader turns by more than `max_deg`. The last offer of a group is to be exactly aligned.
    """
    member, directions = frames(lower(combine_all("union", list(parts))), same_deg)
    groups = [[i for i, g in enumerate(member) if g == group] for group in range(len(directions))]
    return [
        list(_offers(parts, own, shared, max_deg))
        for group, frame in zip(groups, directions, strict=True)
        for own, shared in _directed(parts, group, frame)
    ]


def _directed(parts: Sequence[Primitive], group: Sequence[int], frame: np.ndarray) -> Iterator[tuple[list[int], np.ndarray]]:
    """What turns together, and the frame that it shares: all with a leaf of three directions; what is round has but its axis to share."""
    if any(KINDS.index(parts[i].kind) in FULL for i in group):
        yield list(group), frame
        return
    axes = {i: matrix_from_euler(parts[i].rotation)[:, 2] for i in group}
    along = {i: int(np.abs(axis @ frame).argmax()) for i, axis in axes.items()}
    for k in sorted(set(along.values())):
        own = [i for i in group if along[i] == k]
        yield own, frame_from_axis(axes[own[0]])


def _offers(parts: Sequence[Primitive], own: Sequence[int], frame: np.ndarray, max_deg: float) -> Iterator[Mapping[int, Primitive]]:
    leader = next((parts[i] for i in own if KINDS.index(parts[i].kind) in FULL), parts[own[0]])
    for turned in (*round_turns(leader, max_deg), leader):
        now = _led(frame, leader, turned)
        offer = {i: _along(parts[i], now) for i in own}
        if any(leaf != parts[i] for i, leaf in offer.items()):
            yield offer


def _led(frame: np.ndarray, leader: Primitive, turned: Primitive) -> np.ndarray:
    """A frame [3, 3] after its leader was turned."""
    after = matrix_from_euler(turned.rotation)
    if KINDS.index(leader.kind) in FULL:
        return after
    before = matrix_from_euler(leader.rotation)[:, 2]
    return shortest_turn(before, after[:, 2] * np.sign(before @ after[:, 2])) @ frame


def _along(leaf: Primitive, frame: np.ndarray) -> Primitive:
    rotation = _nearest(KINDS.index(leaf.kind), matrix_from_euler(leaf.rotation), frame)
    return along_axis(leaf, rotation[:, 2]) if is_round(leaf) else in_frame(leaf, rotation)


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
        equal = frame @ EQUAL
        return equal[(equal * rotation).sum((1, 2)).argmax()]
    along = rotation[:, 2] @ frame
    axis = frame[:, int(np.abs(along).argmax())] * np.sign(along[int(np.abs(along).argmax())])
    side = rotation[:, 0] - (rotation[:, 0] @ axis) * axis
    side /= np.linalg.norm(side)
    return np.column_stack([side, np.cross(axis, side), axis])
