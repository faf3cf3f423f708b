"""SolveSpace's solver, through python-solvespace, on the same theories: the independent referee."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from python_solvespace import Constraint as Code
from python_solvespace import Entity, ResultFlag, SolverSystem

from imdim.sketch.theory import SketchConstraint, Theory


class Referee:
    """One theory at one start [n, 3]. Torsions and equal lengths with a shared point aside, it takes what `Theory` takes."""

    def __init__(self, theory: Theory, start: np.ndarray) -> None:
        self.theory, self.system, self.planes = theory, SolverSystem(), 0
        self.base: Any = self.system.create_2d_base() if theory.dimension == 2 else Entity.FREE_IN_3D
        self.system.set_group(2)
        if theory.dimension == 2:
            self.points = [self.system.add_point_2d(x, y, self.base) for x, y, _ in start]
        else:
            self.points = [self.system.add_point_3d(*p) for p in start]
        for constraint in theory.constraints:
            self.add(constraint, start)

    def line(self, a: int, b: int) -> Any:
        if self.theory.dimension == 2:
            return self.system.add_line_2d(self.points[a], self.points[b], self.base)
        return self.system.add_line_3d(self.points[a], self.points[b])

    def add(self, c: SketchConstraint, start: np.ndarray) -> None:
        i, p = c.indices, self.points
        if c.kind == "distance":
            self.system.distance(p[i[0]], p[i[1]], c.value, self.base)
        elif c.kind == "angle":
            legs = self.line(i[1], i[0]), self.line(i[1], i[2])
            self.system.add_constraint(Code.ANGLE, self.base, math.degrees(c.value), Entity.NONE, Entity.NONE, *legs)
        elif c.kind == "equal_length":
            self.system.equal(self.line(*i[:2]), self.line(*i[2:]), self.base)
        elif c.kind == "line_distance":
            self.point_line(c, start)
        elif c.kind == "plane_distance":
            self.point_plane(c, start)
        else:
            raise ValueError(c)

    def point_line(self, c: SketchConstraint, start: np.ndarray) -> None:
        i, line = c.indices, self.line(*c.indices[:2])
        if c.value == 0:
            self.system.coincident(self.points[i[2]], line, self.base)
            return
        side = 1.0
        if self.theory.dimension == 2:  # SolveSpace's distance has a sign there
            t, w = start[i[1]] - start[i[0]], start[i[2]] - start[i[0]]
            side = math.copysign(1.0, w[0] * t[1] - w[1] * t[0])
        self.system.distance(self.points[i[2]], line, side * c.value, self.base)

    def point_plane(self, c: SketchConstraint, start: np.ndarray) -> None:
        """A plane that may turn about its normal, which is one freedom more."""
        a, b, d, e = c.indices
        u = (start[b] - start[a]) / np.linalg.norm(start[b] - start[a])
        n = np.cross(u, start[d] - start[a])
        n /= np.linalg.norm(n)
        q = quaternion(np.stack([u, np.cross(n, u), n], axis=1))
        plane = self.system.add_work_plane(self.points[a], self.system.add_normal_3d(*q))
        self.planes += 1
        for other in (b, d):
            self.system.add_constraint(Code.PT_IN_PLANE, Entity.FREE_IN_3D, 0.0, self.points[other], Entity.NONE, plane, Entity.NONE)
        side = math.copysign(1.0, (start[e] - start[a]) @ n)
        self.system.distance(self.points[e], plane, side * c.value)

    def solve(self) -> bool:
        return self.system.solve() == ResultFlag.OKAY

    def dof(self) -> int:
        """Modulo rigid motions and the turns of auxiliary planes, after `solve`."""
        return self.system.dof() - self.planes - (3 if self.theory.dimension == 2 else 6)

    def solution(self) -> np.ndarray:
        rows = [self.system.params(p.params) for p in self.points]
        return np.array([[*row, 0.0][:3] for row in rows])


def quaternion(r: np.ndarray) -> tuple[float, float, float, float]:
    """w, x, y, z of a rotation matrix [3, 3] (Shepperd 1978): the largest diagonal sum keeps the divisor away from 0."""
    sums = [r[0, 0] + r[1, 1] + r[2, 2], *np.diag(r)]
    k = int(np.argmax(sums))
    if k == 0:
        q = [1 + sums[0], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]
    else:
        i, j, m = (np.arange(3) + k - 1) % 3
        q = [0.0] * 4
        q[0], q[i + 1] = r[m, j] - r[j, m], 1 + r[i, i] - r[j, j] - r[m, m]
        q[j + 1], q[m + 1] = r[j, i] + r[i, j], r[m, i] + r[i, m]
    w, x, y, z = np.array(q) / np.linalg.norm(q)
    return float(w), float(x), float(y), float(z)
