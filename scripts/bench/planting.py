"""Random parts planted as programs, for benches that must know how many primitives suffice.

A part grows from a box or a cylinder by terms of one to three primitives (a nested tree each) that are set on its surface or cut into it.
Numbers are multiples of half a millimetre. Each primitive matters: without it the solid changes by `LEAST` of its volume divided by the
number of primitives, and the part stays one body.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from imdim.geometry.solid import to_manifold, to_trimesh, volume_iou
from imdim.program.tree import OPS, Combine, Primitive, Program, Vec3, fold, leaves

LEAST = 0.08
SEGMENTS = 96
TRIES = 400
ALONG: tuple[Vec3, ...] = ((0.0, 0.0, 0.0), (0.0, 90.0, 0.0), (-90.0, 0.0, 0.0))


def planted(rng: np.random.Generator, primitives: int) -> Program:
    """A random part of so many primitives, each of which matters."""
    while True:
        program = _grown(rng, primitives)
        if program is not None and matters(program) and len(to_manifold(program).decompose()) == 1:
            return program


def mesh_of(program: Program) -> trimesh.Trimesh:
    """The part as a solid modeller would export it."""
    return to_trimesh(to_manifold(program, SEGMENTS))


def matters(program: Program) -> bool:
    """Whether the solid changes visibly without any one of its primitives."""
    whole, n = to_manifold(program), sum(1 for _ in leaves(program))
    rests = [without(program, i) for i in range(n)]
    return all(r is not None and 1 - volume_iou(whole, to_manifold(r)) >= LEAST / n for r in rests) if n > 1 else True


def without(program: Program, index: int) -> Program | None:
    """The program without one of its primitives."""

    def join(op: str, a: Program | None, b: Program | None) -> Program | None:
        if a is not None and b is not None:
            return Combine(op, a, b)  # type: ignore[arg-type]
        return b if a is None and op != "difference" else a

    return fold(program, lambda i, p: None if i == index else p, {op: (lambda a, b, op=op: join(op, a, b)) for op in OPS})


def _grown(rng: np.random.Generator, primitives: int) -> Program | None:
    """Terms added one by one; each must change the solid by a visible amount at once."""
    program: Program = _primitive(rng, np.zeros(3), 60.0, base=True)
    left = primitives - 1
    for _ in range(TRIES):
        if not left:
            return program
        size = min(left, int(rng.choice([1, 1, 1, 2, 3])))
        longer = _extended(rng, program, size, 60.0 / max(1.0, primitives / 10) ** 0.5)
        before, after = to_manifold(program), to_manifold(longer)
        if after.volume() > 0.2 * before.volume() and 1 - volume_iou(before, after) >= 1.5 * LEAST / primitives:
            program, left = longer, left - size
    return None


def _extended(rng: np.random.Generator, program: Program, size: int, scale: float) -> Program:
    mesh = mesh_of(program)
    at = trimesh.sample.sample_surface(mesh, 1, seed=int(rng.integers(2**31)))[0][0]
    op = str(rng.choice(["union", "union", "difference", "difference", "intersection"], p=[0.25, 0.25, 0.225, 0.225, 0.05]))
    if op == "intersection":
        return Combine("intersection", program, _tree(rng, mesh.bounds.mean(0), size, 1.6 * scale))
    return Combine(op, program, _tree(rng, at, size, 0.6 * scale))  # type: ignore[arg-type]


def _tree(rng: np.random.Generator, at: np.ndarray, size: int, scale: float) -> Program:
    """A nested tree of `size` primitives about a place."""
    program: Program = _primitive(rng, at, scale)
    for _ in range(size - 1):
        op = str(rng.choice(["union", "difference", "difference", "intersection"]))
        program = Combine(op, program, _primitive(rng, at + rng.normal(0, 0.2 * scale, 3), 0.7 * scale))  # type: ignore[arg-type]
    return program


def _primitive(rng: np.random.Generator, at: np.ndarray, scale: float, base: bool = False) -> Primitive:
    kind = str(rng.choice(["box", "cylinder", "sphere"], p=[0.6, 0.4, 0.0] if base else [0.45, 0.4, 0.15]))
    edges = _round(scale * rng.uniform(0.3, 1.0, 3))
    center = tuple(float(v) for v in _round(at))
    turn = ALONG[rng.integers(3)]
    if kind == "box":
        return Primitive("box", tuple(float(e) for e in edges), center)  # type: ignore[arg-type]
    if kind == "cylinder":
        return Primitive("cylinder", (float(_round(edges[0] / 2)), float(edges[1])), center, turn)  # type: ignore[arg-type]
    return Primitive("sphere", (float(_round(edges[0] / 2)),), center)  # type: ignore[arg-type]


def _round(v: np.ndarray) -> np.ndarray:
    return np.maximum(np.round(np.abs(v) * 2) / 2, 1.0) * np.where(v < 0, -1, 1)


PITCH = 20.0


def plate(rng: np.random.Generator, primitives: int) -> Program:
    """A plate with a square array of holes, blind holes, bosses, blocks and pockets: as many primitives as wanted, each visible."""
    side = int(np.ceil(np.sqrt(primitives - 1)))
    program: Program = Primitive("box", (PITCH * side, PITCH * side, 10.0), (0.0, 0.0, 5.0))
    added: list[Primitive] = []
    cut: list[Primitive] = []
    for spot in sorted(rng.permutation(side * side)[: primitives - 1].tolist()):
        x, y = ((i - (side - 1) / 2) * PITCH for i in divmod(spot, side))
        kind, wide = rng.integers(5), float(rng.choice([6.0, 8.0, 10.0]))
        if kind == 0:
            cut.append(Primitive("cylinder", (wide / 2, 14.0), (x, y, 5.0)))
        elif kind == 1:
            cut.append(Primitive("cylinder", (wide / 2, 8.0), (x, y, 10.0)))
        elif kind == 2:
            added.append(Primitive("cylinder", (wide / 2, 10.0), (x, y, 12.0)))
        elif kind == 3:
            added.append(Primitive("box", (wide, wide, 12.0), (x, y, 10.0)))
        else:
            cut.append(Primitive("box", (wide, wide, 6.0), (x, y, 10.0)))
    for op, parts in (("union", added), ("difference", cut)):
        for part in parts:
            program = Combine(op, program, part)  # type: ignore[arg-type]
    return program


def write_csv(rows: Sequence[Any], path: Path) -> None:
    """Rows of one dataclass, its fields as columns."""
    with path.open("w", newline="") as out:
        writer = csv.DictWriter(out, [f.name for f in fields(rows[0])])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
