"""The descent of `fit_surface` on spheres, cylinders, cones and tori, compiled.

Most fits have a few dozen corners, for which a step took a hundred calls of numpy. A surface is eight numbers: a point, a unit axis, and
two sizes: the radius and, of a torus, the smaller one, of a cone half the angle, of either sign, the radius then being that at the point.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

SPHERE, CYLINDER, CONE, TORUS = range(4)
CODES = {"sphere": SPHERE, "cylinder": CYLINDER, "cone": CONE, "torus": TORUS}
UNKNOWNS = (4, 5, 6, 7)  # of a step


@njit(nogil=True, cache=True, error_model="numpy")
def descend_surface(kind, start, points, scale, iterations, frozen):
    """Levenberg-Marquardt on the distances of `points` [n, 3], with Tukey's biweight where `scale` is positive; weights are renewed after
    every accepted step, and steps leave out the unknowns that are `frozen` [p]. The surface [8], and the rms of its weighted distances."""
    unknowns = len(frozen)
    state, trial, basis = start.copy(), start.copy(), np.empty((2, 3))
    distance, tried = np.empty(len(points)), np.empty(len(points))
    normal, damped = np.empty((unknowns, unknowns)), np.empty((unknowns, unknowns))
    slope, step = np.empty(unknowns), np.empty(unknowns)
    damping = 1e-3
    _fill_basis(state, basis)
    cost = _measure(kind, state, basis, points, scale, distance)
    _fill_equations(kind, state, basis, points, distance, scale, frozen, normal, slope)
    for _ in range(iterations):
        if np.abs(slope).max() < 1e-14 * len(points):
            break
        trace = 0.0
        for i in range(unknowns):
            trace += normal[i, i]
        for i in range(unknowns):
            step[i] = -slope[i]
            for j in range(unknowns):
                damped[i, j] = normal[i, j]
            damped[i, i] += damping * (normal[i, i] + 1e-9 * (1 + trace))
        _solve(damped, step)
        _move(kind, state, basis, step, trial)
        _fill_basis(trial, basis)
        new_cost = _measure(kind, trial, basis, points, scale, tried)
        if not new_cost < cost:
            _fill_basis(state, basis)
            damping *= 8
            if damping > 1e6:
                break
            continue
        gain, cost = cost - new_cost, new_cost
        state, trial = trial, state
        distance, tried = tried, distance
        damping = max(damping / 6, 1e-12)
        if gain < 1e-11 * cost:
            break
        _fill_equations(kind, state, basis, points, distance, scale, frozen, normal, slope)
    total, squares = 0.0, 0.0
    for i in range(len(points)):
        weight = _weigh(distance[i], scale)
        total += weight
        squares += weight * distance[i] * distance[i]
    return state, math.sqrt(squares / total) if total > 0 else np.inf


@njit(nogil=True, cache=True, error_model="numpy")
def _fill_basis(state, basis):
    """Two unit vectors [2, 3] across the axis."""
    least = 3
    for k in (5, 4, 3):
        if abs(state[k]) <= abs(state[least]):
            least = k
    x, y, z = state[3], state[4], state[5]
    if least == 3:
        basis[0, 0], basis[0, 1], basis[0, 2] = 0.0, z, -y
    elif least == 4:
        basis[0, 0], basis[0, 1], basis[0, 2] = -z, 0.0, x
    else:
        basis[0, 0], basis[0, 1], basis[0, 2] = y, -x, 0.0
    length = math.sqrt(basis[0, 0] ** 2 + basis[0, 1] ** 2 + basis[0, 2] ** 2)
    for k in range(3):
        basis[0, k] /= length
    basis[1, 0] = y * basis[0, 2] - z * basis[0, 1]
    basis[1, 1] = z * basis[0, 0] - x * basis[0, 2]
    basis[1, 2] = x * basis[0, 1] - y * basis[0, 0]


@njit(nogil=True, cache=True, error_model="numpy")
def _weigh(distance, scale):
    if scale <= 0:
        return 1.0
    return max(1 - (distance / (3 * scale)) ** 2, 0.0) ** 2


@njit(nogil=True, cache=True, error_model="numpy")
def _measure(kind, state, basis, points, scale, distance):
    """Fill in the signed distances [n]; their cost."""
    cost = 0.0
    cosine, sine = math.cos(state[7]), math.sin(state[7])
    for i in range(len(points)):
        x, y, z = points[i, 0] - state[0], points[i, 1] - state[1], points[i, 2] - state[2]
        if kind == SPHERE:
            d = math.sqrt(x * x + y * y + z * z) - state[6]
        else:
            across = x * basis[0, 0] + y * basis[0, 1] + z * basis[0, 2]
            aside = x * basis[1, 0] + y * basis[1, 1] + z * basis[1, 2]
            h = x * state[3] + y * state[4] + z * state[5]
            d = math.sqrt(across * across + aside * aside) - state[6]
            if kind == CONE:
                d = d * cosine - h * sine
            elif kind == TORUS:
                d = math.sqrt(d * d + h * h) - state[7]
        distance[i] = d
        if scale <= 0:
            cost += d * d
        else:
            cost += 1 - max(1 - (d / (3 * scale)) ** 2, 0.0) ** 3
    return cost


@njit(nogil=True, cache=True, error_model="numpy")
def _fill_equations(kind, state, basis, points, distance, scale, frozen, normal, slope):
    """The normal equations of a step, [p, p] and [p]: an unknown for each of a sphere's centre and radius; for the others shifts across the
    axis, turns of it, a torus's shift along it, and the sizes."""
    unknowns = len(frozen)
    row = np.empty(unknowns)
    normal[:] = 0.0
    slope[:] = 0.0
    cosine, sine = math.cos(state[7]), math.sin(state[7])
    for i in range(len(points)):
        weight = _weigh(distance[i], scale)
        x, y, z = points[i, 0] - state[0], points[i, 1] - state[1], points[i, 2] - state[2]
        if kind == SPHERE:
            length = max(math.sqrt(x * x + y * y + z * z), 1e-12)
            row[0], row[1], row[2], row[3] = -x / length, -y / length, -z / length, -1.0
        else:
            across = x * basis[0, 0] + y * basis[0, 1] + z * basis[0, 2]
            aside = x * basis[1, 0] + y * basis[1, 1] + z * basis[1, 2]
            h = x * state[3] + y * state[4] + z * state[5]
            rho = math.sqrt(across * across + aside * aside)
            out, turn = 1.0, -h
            row[4] = -1.0
            if kind == CONE:
                out, turn = cosine, -(h * cosine + rho * sine)
                row[4], row[5] = -cosine, -(rho - state[6]) * sine - h * cosine
            elif kind == TORUS:
                d = rho - state[6]
                least = max(math.sqrt(d * d + h * h), 1e-12)
                out = d / least
                turn = h / least * rho - out * h
                row[4], row[5], row[6] = -h / least, -out, -1.0
            u, v = across / max(rho, 1e-12), aside / max(rho, 1e-12)
            row[0], row[1], row[2], row[3] = -out * u, -out * v, turn * u, turn * v
        for j in range(unknowns):
            if not frozen[j]:
                weighted = weight * row[j]
                slope[j] += weighted * distance[i]
                for k in range(j + 1):
                    if not frozen[k]:
                        normal[j, k] += weighted * row[k]
    for j in range(unknowns):
        for k in range(j):
            normal[k, j] = normal[j, k]


@njit(nogil=True, cache=True, error_model="numpy")
def _solve(matrix, right):
    """Solve a system [p, p] of which `right` [p] is the right side, and then the answer: by elimination, the largest pivot first."""
    n = len(right)
    for i in range(n):
        best = i
        for r in range(i + 1, n):
            if abs(matrix[r, i]) > abs(matrix[best, i]):
                best = r
        if best != i:
            right[i], right[best] = right[best], right[i]
            for c in range(n):
                matrix[i, c], matrix[best, c] = matrix[best, c], matrix[i, c]
        for r in range(i + 1, n):
            share = matrix[r, i] / matrix[i, i]
            right[r] -= share * right[i]
            for c in range(i + 1, n):
                matrix[r, c] -= share * matrix[i, c]
    for i in range(n - 1, -1, -1):
        for c in range(i + 1, n):
            right[i] -= matrix[i, c] * right[c]
        right[i] /= matrix[i, i]


@njit(nogil=True, cache=True, error_model="numpy")
def _move(kind, state, basis, step, trial):
    """Fill in the surface [8] after a step."""
    if kind == SPHERE:
        for k in range(3):
            trial[k], trial[3 + k] = state[k] + step[k], state[3 + k]
        trial[6], trial[7] = state[6] + step[3], state[7]
        return
    along = step[4] if kind == TORUS else 0.0
    length = 0.0
    for k in range(3):
        trial[k] = state[k] + step[0] * basis[0, k] + step[1] * basis[1, k] + along * state[3 + k]
        trial[3 + k] = state[3 + k] + step[2] * basis[0, k] + step[3] * basis[1, k]
        length += trial[3 + k] ** 2
    for k in range(3, 6):
        trial[k] /= math.sqrt(length)
    first = 5 if kind == TORUS else 4
    trial[6] = state[6] + step[first]
    trial[7] = state[7] if kind == CYLINDER else state[7] + step[first + 1]
