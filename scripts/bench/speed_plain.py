"""The same answers as the fast kernels, written as one would write them first: numpy and torch, one thing after another."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import torch

from imdim.data.solids import BOX, SPHERE, Solids
from imdim.data.surfaces import STEP, bounds, surface_areas
from imdim.geometry.lowering import pack
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.sdf import program_sdf
from imdim.learn.decode import DecodeStep
from imdim.learn.policy import Move, Policy
from imdim.program.tree import Program, Vec3, leaves


def tangent_from_params(euler_deg: Vec3) -> np.ndarray:
    """The [9, 9] derivative of the local-frame coordinates with respect to sizes, centre and Euler degrees."""
    rotation = matrix_from_euler(euler_deg)
    _, ry, rz = euler_deg
    # the world axes about which the three angles turn: Rz Ry x, Rz y, z
    axes = np.stack([matrix_from_euler((0.0, ry, rz))[:, 0], matrix_from_euler((0.0, 0.0, rz))[:, 1], (0.0, 0.0, 1.0)], axis=1)
    out = np.eye(9)
    out[3:6, 3:6] = rotation.T
    out[6:9, 6:9] = rotation.T @ axes * (math.pi / 180)
    return out


def chamfer(a: np.ndarray, b: np.ndarray, rows: int = 256) -> float:
    """All distances of `a` [n, 3] to `b` [m, 3], some rows at a time, and the least of each row and column."""
    near_a, near_b = np.full(len(a), np.inf), np.full(len(b), np.inf)
    for i in range(0, len(a), rows):
        distance = np.sqrt(((a[i : i + rows, None] - b[None]) ** 2).sum(2))
        near_a[i : i + rows] = distance.min(1)
        near_b = np.minimum(near_b, distance.min(0))
    return float(near_a.mean() + near_b.mean())


def solver_step(program: Program, maps: np.ndarray, points: np.ndarray, scale: float, damping: float, support: float) -> np.ndarray:
    """One step [k, 9] of Levenberg and Marquardt in the coordinates of `maps` [k, 9, 9], from the whole Jacobian [n, 9 k] that
    differentiation in reverse gives."""
    k = len(maps)
    value, by_params = _differentiated(program, points)
    chain = [np.linalg.solve(tangent_from_params(leaf.rotation), m) for leaf, m in zip(leaves(program), maps, strict=True)]
    jacobian, residual = np.concatenate([by_params[:, i] @ chain[i] for i in range(k)], 1), value
    weight = 1 / (1 + (residual / scale) ** 2) ** 2
    matrix, gradient = jacobian.T @ (weight[:, None] * jacobian), jacobian.T @ (weight * residual)
    diagonal = np.diag(matrix).reshape(k, 9)
    shown = (diagonal >= support * np.array([1.0] * 6 + [1e-3] * 3)).ravel()
    matrix[~shown], matrix[:, ~shown], gradient[~shown] = 0, 0, 0
    kept = np.where(shown, diagonal.ravel(), 0).reshape(k, 9)
    lift = np.where(shown, (damping * kept + 1e-9 * kept.max(1, keepdims=True)).ravel(), 1.0)
    return -np.linalg.solve(matrix + np.diag(lift), gradient).reshape(k, 9)


def gradients(program: Program, points: np.ndarray) -> np.ndarray:
    """Values and derivatives [n, 1 + 9] by the row of the deciding leaf; those by all others are nought."""
    value, by_params = _differentiated(program, points)
    return np.column_stack([value, by_params.sum(1)])


def _differentiated(program: Program, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values [n] and their derivatives [n, k, 9] by all numbers, differentiated in reverse."""
    kinds, params = pack(program)
    free = torch.tensor(params).expand(len(points), len(kinds), 9).clone().requires_grad_()
    value = program_sdf(program, free, torch.tensor(points)[:, None])[:, 0]
    value.sum().backward()
    assert free.grad is not None
    return value.detach().numpy(), free.grad.numpy()


def proposals(policy: Policy, states: Sequence[DecodeStep]) -> list[Move]:
    """The moves of each state of each target, one after another."""
    return [policy.propose(step.seen.of(torch.tensor([i]))) for step in states for i in range(len(step.rows))]


def surface_cloud(solids: Solids, n: int, generator: torch.Generator) -> list[np.ndarray]:
    """`n` points of the boundary of each row, drawn in the order in which `data.surfaces` draws; rows without enough come short."""
    found: list[list[np.ndarray]] = [[] for _ in solids.kinds]
    low, high = (v.numpy().astype(float) for v in bounds(solids))
    for _ in range(4):
        poor = [row for row, points in enumerate(found) if sum(map(len, points)) < n]
        if not poor:
            break
        area = surface_areas(solids[torch.tensor(poor)])
        owner = torch.multinomial(area, 2 * n, replacement=True, generator=generator)
        u = torch.rand(*owner.shape, 3, generator=generator)
        torch.rand(*owner.shape, generator=generator)  # thins rings and ellipsoids, of which there are none here
        for i, row in enumerate(poor):
            step = STEP * float(np.linalg.norm(high[row] - low[row]))
            found[row].append(_boundary(solids, row, owner[i].numpy(), u[i].numpy(), step))
    return [np.concatenate(points)[:n] for points in found]


def _boundary(solids: Solids, row: int, owner: np.ndarray, u: np.ndarray, step: float) -> np.ndarray:
    """Of the candidates of one row, in order, those that lie on the boundary and belong to the first primitive there."""
    parts = [part for part in range(solids.kinds.shape[1]) if solids.kinds[row, part] >= 0]
    points, normals = np.empty((len(owner), 3)), np.empty((len(owner), 3))
    for part in parts:
        mine = owner == part
        rotation = solids.rotations[row, part].numpy().astype(float)
        local, direction = _on_surface(int(solids.kinds[row, part]), solids.sizes[row, part].numpy().astype(float), u[mine])
        points[mine], normals[mine] = local @ rotation.T + solids.centers[row, part].numpy(), direction @ rotation.T
    solid, first = np.zeros((2, len(owner)), bool), np.full(len(owner), -1)
    for part in reversed(parts):
        first[_holds(solids, row, part, points - step * normals) != _holds(solids, row, part, points + step * normals)] = part
    for side, at in enumerate((points - step * normals, points + step * normals)):
        for part in parts:
            solid[side][_holds(solids, row, part, at)] = bool(solids.positive[row, part])
    return points[(solid[0] != solid[1]) & (first == owner)]


def _holds(solids: Solids, row: int, part: int, points: np.ndarray) -> np.ndarray:
    local = (points - solids.centers[row, part].numpy()) @ solids.rotations[row, part].numpy().astype(float)
    a, b, c = solids.sizes[row, part].tolist()
    kind = int(solids.kinds[row, part])
    if kind == BOX:
        return (np.abs(local) < np.array([a, b, c]) / 2).all(1)
    if kind == SPHERE:
        return np.linalg.norm(local, axis=1) < a
    return (np.hypot(local[:, 0], local[:, 1]) < a) & (np.abs(local[:, 2]) < b / 2)


def _on_surface(kind: int, size: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals [m, 3] of uniform numbers `u` [m, 3], by the maps of `data.surfaces`."""
    if kind == BOX:
        return _on_box(size, u)
    if kind == SPHERE:
        z, angle = 2 * u[:, 0] - 1, 2 * np.pi * u[:, 1]
        ring = np.sqrt(1 - z * z)
        direction = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], 1)
        return size[0] * direction, direction
    radius, height = size[0], size[1]
    at, angle = u[:, 0] * (radius + height), 2 * np.pi * u[:, 2]
    low, high = at < radius / 2, at >= radius / 2 + height
    side, end = ~(low | high), np.where(low, -1.0, 1.0)
    rho, z = np.where(side, radius, radius * np.sqrt(u[:, 1])), np.where(side, u[:, 1] - 0.5, end / 2) * height
    circle = np.stack([np.cos(angle), np.sin(angle)], 1)
    points = np.concatenate([rho[:, None] * circle, z[:, None]], 1)
    return points, np.concatenate([side[:, None] * circle, np.where(side, 0.0, end)[:, None]], 1)


def _on_box(size: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    areas = np.cumsum([size[1] * size[2], size[2] * size[0], size[0] * size[1]])
    pick = 2 * u[:, 0]
    axis = (areas[:2] <= (pick % 1)[:, None] * areas[2]).sum(1)
    sign = np.where(pick < 1, -1.0, 1.0)
    points, normals = np.empty((len(u), 3)), np.zeros((len(u), 3))
    for fixed in range(3):
        mine = axis == fixed
        one, two = (i for i in range(3) if i != fixed)
        points[mine, fixed] = sign[mine] / 2 * size[fixed]
        points[mine, one], points[mine, two] = (u[mine, 1] - 0.5) * size[one], (u[mine, 2] - 0.5) * size[two]
        normals[mine, fixed] = sign[mine]
    return points, normals
