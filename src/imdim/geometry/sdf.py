"""The leaf table and its folds in torch: differentiable, batched, on any device. It is the reference of the other backends.

Distances are negative inside. All kinds but the ellipsoid and the drafted outline have their exact Euclidean distance. The ellipsoid
has the first-order distance ``k0 (k0 - 1) / k1`` with ``k0 = |q / s|``, ``k1 = |q / s^2|``, not below ``-min(s)``: its sign and zero
set are exact, its gradient has length one on the surface, and away from it the value is an estimate that does not exceed
``|q| - min(s)``. A drafted outline has the distance within its section at the height of the point, times the cosine of the draft: exact
where a wall is nearest, an estimate beside the slanted edges of its walls. A program's value, the minimum and maximum of those, has the
exact sign and but for those estimates is a lower bound of the distance outside (Hart 1996, "Sphere tracing", section 2).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.linalg import vector_norm

from imdim.geometry.lowering import NO_OUTLINES, Outlines, follow_curves, pack, unpack
from imdim.geometry.rotations import rotation_rows
from imdim.program.tree import FULL_TURN, KINDS, Op, Program, fold, leaves

__all__ = [
    "LOCAL_SDF",
    "OUTLINED_SDF",
    "SDF_OPS",
    "fold_table",
    "leaf_table",
    "pack",
    "program_sdf",
    "rotation_matrices",
    "to_local",
    "unpack",
]

NEWTON = 40  # steps to the foot on an ellipse, most of which change nothing any more

SDF_OPS: Mapping[Op, Callable[[Tensor, Tensor], Tensor]] = {
    "union": torch.minimum,
    "intersection": torch.maximum,
    "difference": lambda keep, cut: torch.maximum(keep, -cut),
}


def leaf_table(kinds: np.ndarray, params: Tensor, points: Tensor, outlines: Outlines = NO_OUTLINES, curves: Tensor | None = None) -> Tensor:
    """Signed distances [..., k, n] of `points` [..., n, 3] to the leaves `kinds` [k], `params` [..., k, 9]; leading axes broadcast.

    `curves` [c, 5] (both ends and bulge, of an ellipse as `Outlines` has them) stand in for those of the `outlines`, where a derivative
    by them is wanted.
    """
    local = to_local(params, points)
    drawn = params.new_tensor(outlines.curves[:, :5]) if curves is None else curves
    is_ellipse = torch.as_tensor(outlines.curves[:, 7] < 0, device=params.device)
    rows: list[Tensor] = [params.new_empty(0)] * len(kinds)
    for kind in np.unique(kinds):
        members = np.flatnonzero(kinds == kind)
        index = torch.as_tensor(members, device=params.device)
        sizes = params[..., :3].index_select(-2, index)[..., None, :]
        places = local.index_select(-3, index)
        if (name := KINDS[kind]) in LOCAL_SDF:
            values = LOCAL_SDF[name](places, sizes)
        else:
            spans = [slice(*outlines.spans[leaf]) for leaf in members]
            drawings = [_Drawing(drawn[span][~is_ellipse[span]], drawn[span][is_ellipse[span]]) for span in spans]
            values = torch.stack([OUTLINED_SDF[name](places[..., i, :, :], sizes[..., i, :, :], d) for i, d in enumerate(drawings)], -2)
        for row, leaf in enumerate(members):
            rows[leaf] = values[..., row, :]
    return torch.stack(rows, -2)


def fold_table(program: Program, table: Tensor) -> Tensor:
    """The program's values [..., n] from its leaf table [..., k, n]."""
    return fold(program, lambda i, _: table[..., i, :], SDF_OPS)


def program_sdf(program: Program, params: Tensor, points: Tensor, curves: Tensor | None = None) -> Tensor:
    """Values [..., n] at `points` [..., n, 3] of the structure of `program` with the numbers `params` [..., k, 9].

    `curves` [c, 5], of all leaves in order, are those of the program's outlines where none are given.
    """
    parts = [*leaves(program)]
    return fold_table(program, leaf_table(pack(program)[0], params, points, Outlines.of(parts), curves))


def to_local(params: Tensor, points: Tensor) -> Tensor:
    """World `points` [..., n, 3] in the frame of each leaf [..., k, n, 3]."""
    offsets = points[..., None, :, :] - params[..., :, None, 3:6]
    return offsets @ rotation_matrices(params[..., 6:9])


def rotation_matrices(euler_deg: Tensor) -> Tensor:
    """``Rz @ Ry @ Rx`` [..., 3, 3] of Euler degrees [..., 3]."""
    rows = rotation_rows(*(f(euler_deg * (math.pi / 180)).unbind(-1) for f in (torch.cos, torch.sin)))
    return torch.stack([torch.stack(row, -1) for row in rows], -2)


def _from_faces(distances: Tensor) -> Tensor:
    """Distance [...] to the corner of the half-spaces with signed distances [..., m] and orthogonal normals."""
    deepest = distances.amax(-1)
    return torch.where(deepest > 0, vector_norm(distances.clamp_min(0), dim=-1), deepest)


def _cylinder(q: Tensor, size: Tensor) -> Tensor:
    rho = vector_norm(q[..., :2], dim=-1)
    return _from_faces(torch.stack([rho - size[..., 0], q[..., 2].abs() - size[..., 1] / 2], -1))


def _cone(q: Tensor, size: Tensor) -> Tensor:
    """In the half plane (rho, z) the solid is a convex trapezoid: inside, the nearest edge line; outside, the nearest edge segment."""
    rho, z = vector_norm(q[..., :2], dim=-1), q[..., 2]
    bottom, top, height = size.unbind(-1)
    edge = torch.stack(torch.broadcast_tensors(top - bottom, height), -1)
    from_rim = torch.stack([rho - bottom, z + height / 2], -1)
    t = ((from_rim * edge).sum(-1) / (edge * edge).sum(-1)).clamp(0, 1)
    slant = from_rim - t[..., None] * edge
    above = z.abs() - height / 2
    beside = rho - torch.where(z < 0, bottom, top)
    cap = torch.stack([beside.clamp_min(0), above], -1)
    nearer = (cap * cap).sum(-1, keepdim=True) < (slant * slant).sum(-1, keepdim=True)
    normal = torch.stack([edge[..., 1], -edge[..., 0]], -1) / vector_norm(edge, dim=-1, keepdim=True)
    inside = torch.maximum((from_rim * normal).sum(-1), above)
    return torch.where(inside > 0, vector_norm(torch.where(nearer, cap, slant), dim=-1), inside)


def _torus(q: Tensor, size: Tensor) -> Tensor:
    rho = vector_norm(q[..., :2], dim=-1)
    return vector_norm(torch.stack([rho - size[..., 0], q[..., 2]], -1), dim=-1) - size[..., 1]


def _ellipsoid(q: Tensor, size: Tensor) -> Tensor:
    k0, k1 = vector_norm(q / size, dim=-1), vector_norm(q / size**2, dim=-1)
    deepest = -size.amin(-1).expand_as(k0)
    central = k1 == 0
    return torch.where(central, deepest, torch.maximum(k0 * (k0 - 1) / torch.where(central, 1.0, k1), deepest))


class _Drawing(NamedTuple):
    """The `curves` [c, 5] of one outline and its `ellipses` [e, 5]: both ends of the first axis and the ratio of the semi-axes."""

    curves: Tensor
    ellipses: Tensor


def _outline(x: Tensor, y: Tensor, drawing: _Drawing, turned: bool = False) -> Tensor:
    """Signed distances [..., n] of points of the plane to the loops of a drawing: to the nearest one, and inside where an odd number of
    them hold a point."""
    distance, odd = x.new_full(x.shape, math.inf), torch.zeros_like(x, dtype=torch.bool)
    if len(drawing.curves):
        distance, odd = _rings(x, y, drawing.curves, turned)
    for ellipse in drawing.ellipses:
        beside, held = _ellipse(x, y, ellipse)
        distance, odd = torch.minimum(distance, beside), odd ^ held
    return distance * torch.where(odd, -1.0, 1.0)


def _ellipse(x: Tensor, y: Tensor, ellipse: Tensor) -> tuple[Tensor, Tensor]:
    """Distances [..., n] to one ellipse [5], and whether it holds the points; see `ellipse.ellipse_foot`.

    The foot's eccentric angle is taken as a constant: it is where the distance is least, so that its own derivative adds nothing.
    """
    start, end, ratio = ellipse[:2], ellipse[2:4], ellipse[4].abs()
    center, axis = (start + end) / 2, (end - start) / 2
    rx = vector_norm(axis)
    c, s, ry = axis[0] / rx, axis[1] / rx, ratio * rx
    u, v = c * (x - center[0]) + s * (y - center[1]), c * (y - center[1]) - s * (x - center[0])
    with torch.no_grad():
        cosine, sine = _foot_angle(u.abs(), v.abs(), rx, ry) if rx >= ry else _foot_angle(v.abs(), u.abs(), ry, rx)[::-1]
        cosine, sine = torch.where(u < 0, -cosine, cosine), torch.where(v < 0, -sine, sine)
    away = torch.stack([u - rx * cosine, v - ry * sine], -1)
    return vector_norm(away, dim=-1), (u / rx) ** 2 + (v / ry) ** 2 < 1


def _foot_angle(x: Tensor, y: Tensor, rx: Tensor, ry: Tensor) -> tuple[Tensor, Tensor]:
    """Cosines and sines of the feet's eccentric angles, for x, y >= 0 and rx >= ry."""
    r, p, q = (rx / ry) ** 2, rx * x / ry**2, y / ry
    w = torch.maximum(q, p - r + 1)
    between = (q == 0) & (w <= 0)  # the foci, where the root is 0
    w = torch.where(between, 1.0, w)
    for _ in range(NEWTON):
        a, b = p / (w + r - 1), q / w
        w = w + ((a * a + b * b - 1) / (2 * (a * a / (w + r - 1) + b * b / w))).clamp_min(0).nan_to_num(0.0)
    a, b = p / (w + r - 1), q / w
    length = torch.hypot(a, b).clamp_min(1e-300)
    inner = torch.where(r > 1, p / (r - 1).clamp_min(1e-300), 0.0)
    return torch.where(between, inner, a / length), torch.where(between, (1 - inner**2).clamp_min(0).sqrt(), b / length)


def _rings(x: Tensor, y: Tensor, curves: Tensor, turned: bool) -> tuple[Tensor, Tensor]:
    """Distances [..., n] to the loops of `curves` [c, 5], or of those of each point [..., n, c, 5], and whether an odd number of them hold
    the points.

    The parity of crossings is that of the chords, turned for each arc that has the point between it and its chord (see
    `outline.is_in_loop`). Lines along the axis of what is `turned` bound nothing.
    """
    if turned:
        curves = curves[(curves[:, [0, 2, 4]] != 0).any(1)]
    start, end, bulge = curves[..., :2], curves[..., 2:4], curves[..., 4]
    p, chord = torch.stack([x, y], -1)[..., None, :], end - start  # [..., n, 1, 2] and [.., c, 2]
    arc, signed = bulge != 0, torch.where(bulge != 0, bulge, 1.0)
    t = (((p - start) * chord).sum(-1) / (chord * chord).sum(-1)).clamp(0, 1)
    to_line = vector_norm(p - start - t[..., None] * chord, dim=-1)
    normal = torch.stack([-chord[..., 1], chord[..., 0]], -1)
    center = (start + end) / 2 + normal * ((1 - signed**2) / (4 * signed))[..., None]
    radius = vector_norm(chord, dim=-1) * (1 + signed**2) / (4 * signed.abs())
    away = vector_norm(p - center, dim=-1)
    foot = center + (p - center) * (radius / torch.where(away > 0, away, 1.0))[..., None]
    to_ends = torch.minimum(vector_norm(p - start, dim=-1), vector_norm(p - end, dim=-1))
    # at its centre an arc is as near as its radius, wherever the foot falls
    to_arc = torch.where((_left_of(foot, start, chord) * signed <= 0) | (away == 0), (away - radius).abs(), to_ends)
    level = chord[..., 1] == 0
    falls = (chord[..., 1] < 0) | (level & (chord[..., 0] < 0))
    side = torch.where(falls, -_left_of(p, end, chord), _left_of(p, start, chord))
    left = (side > 0) | ((side == 0) & level)
    crossed = ((start[..., 1] > p[..., 1]) != (end[..., 1] > p[..., 1])) & left
    between = arc & (away < radius) & (left == ((bulge > 0) == falls))
    odd = (crossed.sum(-1) + between.sum(-1)) % 2 == 1
    return torch.where(arc, to_arc, to_line).amin(-1), odd


def _left_of(p: Tensor, start: Tensor, chord: Tensor) -> Tensor:
    """Positive where points lie left of chords."""
    return chord[..., 0] * (p[..., 1] - start[..., 1]) - chord[..., 1] * (p[..., 0] - start[..., 0])


def _extrude(q: Tensor, size: Tensor, drawing: _Drawing) -> Tensor:
    return _from_faces(torch.stack([_outline(q[..., 0], q[..., 1], drawing), q[..., 2].abs() - size[..., 0] / 2], -1))


def _drafted(q: Tensor, size: Tensor, drawing: _Drawing) -> Tensor:
    """From the section at the height of a point, see `program/drafting.py`."""
    height, lean = size[..., 0], torch.deg2rad(size[..., 1])
    up = torch.minimum((q[..., 2] + height / 2).clamp_min(0), height) * torch.tan(lean)
    steps = _draft_steps(drawing.curves)
    curves = drawing.curves.expand(*up.shape, *drawing.curves.shape)
    moved = torch.cat([curves[..., :4] + up[..., None, None] * steps, curves[..., 4:]], -1)
    distance, odd = _rings(q[..., 0], q[..., 1], moved, turned=False)
    walls = distance * torch.where(odd, -1.0, 1.0) * torch.cos(lean)
    return _from_faces(torch.stack([walls, q[..., 2].abs() - height / 2], -1))


def _draft_steps(curves: Tensor) -> Tensor:
    """How both ends [c, 4] of the curves [c, 5] of an outline move per unit of inset, as `lowering.draft_motions` has it."""
    start, end, bulge = curves[:, :2], curves[:, 2:4], curves[:, 4:]
    chord = end - start
    left = torch.stack([-chord[:, 1], chord[:, 0]], -1)
    is_arc, signed = bulge != 0, torch.where(bulge != 0, bulge, 1.0)
    center = (start + end) / 2 + left * (1 - signed**2) / (4 * signed)
    at_start, at_end = (torch.where(is_arc, (center - p) * signed, left) for p in (start, end))
    follows = torch.as_tensor(follow_curves(curves.detach().cpu().numpy()), device=curves.device)
    before = at_end / vector_norm(at_end, dim=-1, keepdim=True)
    after = (at_start / vector_norm(at_start, dim=-1, keepdim=True))[follows]
    corner = (before + after) / (1 + (before * after).sum(-1, keepdim=True))
    step = torch.where(is_arc[follows], after, torch.where(is_arc, before, corner))
    own = torch.empty_like(step).index_copy(0, follows, step)
    return torch.cat([own, step], -1)


def _revolve(q: Tensor, size: Tensor, drawing: _Drawing) -> Tensor:
    """In its own half plane a point has the outline, where that is turned; else the nearer of the two end faces."""
    rho, z, angle = vector_norm(q[..., :2], dim=-1), q[..., 2], torch.deg2rad(size[..., 0])
    whole = _outline(rho, z, drawing, turned=True)
    at = torch.atan2(q[..., 1], q[..., 0]) % (2 * math.pi)
    # what lies farther round than a right angle has the axis as the nearest of an end face, if that is in the outline
    depth = rho * torch.sin(torch.minimum(at, angle - at).clamp(0, math.pi / 2))
    off = torch.minimum(at - angle, 2 * math.pi - at).clamp_min(0)
    beyond = vector_norm(torch.stack([_outline(rho * torch.cos(off), z, drawing).clamp_min(0), rho * torch.sin(off)], -1), dim=-1)
    part = torch.where(at <= angle, torch.maximum(whole, -depth), beyond)
    return torch.where(size[..., 0] >= FULL_TURN, whole, part)


# Local points [..., n, 3] and sizes [..., 1, 3] to signed distances [..., n].
LOCAL_SDF: Mapping[str, Callable[[Tensor, Tensor], Tensor]] = {
    "box": lambda q, size: _from_faces(q.abs() - size / 2),
    "sphere": lambda q, size: vector_norm(q, dim=-1) - size[..., 0],
    "cylinder": _cylinder,
    "cone": _cone,
    "torus": _torus,
    "ellipsoid": _ellipsoid,
}

# As above for the kinds that are drawn, one leaf: local points [..., n, 3], sizes [..., 1, 3] and its drawing.
OUTLINED_SDF: Mapping[str, Callable[[Tensor, Tensor, _Drawing], Tensor]] = {
    "extrude": _extrude,
    "revolve": _revolve,
    "drafted": _drafted,
}
