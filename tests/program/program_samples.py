"""Random programs, and membership written straight from the definitions: the truth that the conversions are held against."""

from collections.abc import Sequence

import numpy as np
from outlined_samples import random_drawn, wraps

from imdim.geometry.rotations import matrix_from_euler
from imdim.program.drafting import shrink
from imdim.program.outline import flatten_loop
from imdim.program.tree import OPS, OUTLINED, SIMPLE, SIZE_NAMES, Combine, Op, Primitive, Program, fold

SIGNED: tuple[Op, ...] = ("union", "difference")


def random_primitive(rng: np.random.Generator, kinds: Sequence[str] = SIMPLE) -> Primitive:
    kind = str(rng.choice(kinds))
    size = tuple(float(v) for v in rng.uniform(0.2, 0.8, len(SIZE_NAMES[kind])))
    if kind == "torus":
        size = (max(size), 0.5 * min(size))
    x, y, z, rx, ry, rz = (float(v) for v in (*rng.uniform(-0.5, 0.5, 3), *rng.uniform(-180, 180, 3)))
    if kind in OUTLINED:
        return random_drawn(rng, kind, size[0], (x, y, z), (rx, ry, rz))
    return Primitive(kind, size, (x, y, z), (rx, ry, rz))


def random_program(rng: np.random.Generator, k: int, ops: Sequence[Op] = OPS, kinds: Sequence[str] = SIMPLE, reuse: float = 0.0) -> Program:
    """A random tree of k primitives; each one repeats an earlier one with chance `reuse`."""
    pool: list[Primitive] = []
    for _ in range(k):
        again = pool and rng.random() < reuse
        pool.append(pool[rng.integers(len(pool))] if again else random_primitive(rng, kinds))
    parts: list[Program] = [*pool]
    while len(parts) > 1:
        i = int(rng.integers(len(parts) - 1))
        parts[i : i + 2] = [Combine(ops[rng.integers(len(ops))], parts[i], parts[i + 1])]
    return parts[0]


def left_fold(rng: np.random.Generator, k: int, kinds: Sequence[str] = SIMPLE) -> Program:
    program: Program = random_primitive(rng, kinds)
    for _ in range(k - 1):
        program = Combine(SIGNED[rng.integers(2)], program, random_primitive(rng, kinds))
    return program


def inside_primitive(p: Primitive, points: np.ndarray) -> np.ndarray:
    """Membership [n] of points [n, 3] by the equation of the solid, squares and all."""
    x, y, z = ((points - p.center) @ matrix_from_euler(p.rotation)).T
    rho = np.hypot(x, y)
    if p.kind == "box":
        return (abs(x) < p.size[0] / 2) & (abs(y) < p.size[1] / 2) & (abs(z) < p.size[2] / 2)
    if p.kind == "sphere":
        return x * x + y * y + z * z < p.size[0] ** 2
    if p.kind == "cylinder":
        return (rho < p.size[0]) & (abs(z) < p.size[1] / 2)
    if p.kind == "cone":
        return (abs(z) < p.size[2] / 2) & (rho < np.interp(z, (-p.size[2] / 2, p.size[2] / 2), p.size[:2]))
    if p.kind == "torus":
        return (rho - p.size[0]) ** 2 + z * z < p.size[1] ** 2
    if p.outline is not None and p.kind == "extrude":
        return wraps(p.outline, np.column_stack([x, y])) & (abs(z) < p.size[0] / 2)
    if p.outline is not None and p.kind == "drafted":
        return inside_drafted(p, x, y, z)
    if p.outline is not None:
        return wraps(p.outline, np.column_stack([rho, z])) & (np.degrees(np.arctan2(y, x)) % 360 <= p.size[0])
    return (x / p.size[0]) ** 2 + (y / p.size[1]) ** 2 + (z / p.size[2]) ** 2 < 1


def inside_drafted(p: Primitive, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """By the corners of the section at the height of each point, between those of the foot and of the top."""
    assert p.outline is not None
    found = abs(z) < p.size[0] / 2
    within = np.flatnonzero(found)
    x, y, share = x[within], y[within], z[within] / p.size[0] + 0.5
    top = shrink(p.outline, p.size[0] * np.tan(np.radians(p.size[1])))
    odd = np.zeros(len(within), bool)
    for below, above in zip(p.outline.loops, top.loops, strict=True):
        low, high = (np.array(flatten_loop(loop, 960)) for loop in (below, above))
        rise = high - low
        for k in range(len(low)):
            py, qy = low[k - 1, 1] + share * rise[k - 1, 1], low[k, 1] + share * rise[k, 1]
            c = np.flatnonzero((py > y) != (qy > y))  # few points are at the height of a chord
            px, qx = (low[i, 0] + share[c] * rise[i, 0] for i in (k - 1, k))
            odd[c] ^= x[c] < px + (y[c] - py[c]) * (qx - px) / (qy[c] - py[c])
    found[within] = odd
    return found


def inside(program: Program, points: np.ndarray) -> np.ndarray:
    """Membership [n] in the whole program."""
    ops = {"union": np.logical_or, "intersection": np.logical_and, "difference": lambda a, b: a & ~b}
    return fold(program, lambda _, p: inside_primitive(p, points), ops)


def cloud(rng: np.random.Generator, n: int = 4000) -> np.ndarray:
    """Points [n, 3] over the region in which random programs lie."""
    return rng.uniform(-1.5, 1.5, (n, 3))
