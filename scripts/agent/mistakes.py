"""Ten parts and a program of each with one mistake in it, as a search or a hurried person makes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from imdim.app.lab.examples import PROGRAMS
from imdim.delivery.finish import FinishedProgram, finish
from imdim.export.edit import open_delivered
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program import codec
from imdim.program.tree import Combine, Primitive, Program, leaves, map_leaves, map_lengths
from imdim.reconstruction.fitting import relations_of

BRACKET, FLANGE, LEVER = (PROGRAMS[name]() for name in ("Bracket", "Flange", "Lever"))
INCH = 25.4


def _angle() -> Program:
    """A base, a wall on it, and two ribs between them."""
    base, wall = Primitive("box", (60.0, 40.0, 6.0)), Primitive("box", (6.0, 40.0, 36.0), (-27.0, 0.0, 15.0))
    ribs = [Primitive("box", (18.0, 4.0, 12.0), (-15.0, y, 9.0)) for y in (-14.0, 14.0)]
    out = Combine("union", Combine("union", Combine("union", base, wall), ribs[0]), ribs[1])
    return Combine("difference", out, Primitive("cylinder", (4.0, 20.0), (15.0, 0.0, 0.0)))


ANGLE = _angle()


@dataclass(frozen=True)
class SeededMistake:
    """A true program, and the wrong one that is to be repaired."""

    true: Program
    wrong: Program

    def write(self, folder: Path) -> None:
        """The part as part.stl, and the wrong program as results/program.json, with the names that its own numbers give it."""
        to_trimesh(to_manifold(self.true)).export(folder / "part.stl")
        (folder / "results").mkdir()
        (folder / "results/program.json").write_text(_document(_finish(self.wrong)), encoding="utf-8")

    def names(self) -> dict[str, float]:
        """The names that the true program's numbers give it, with their values."""
        delivered = open_delivered(codec.parse(_document(_finish(self.true))), {})
        return {**delivered.values, **delivered.counts}


def _finish(program: Program) -> FinishedProgram:
    return finish(*relations_of(program))


def _document(found: FinishedProgram) -> str:
    return codec.dumps(found.program, codec.Meta(), found.constraints, found.folded, found.edges)


def _with(program: Program, changes: Mapping[int, Callable[[Primitive], Primitive]]) -> Program:
    return map_leaves(program, lambda i, p: changes[i](p) if i in changes else p)


def _sized(*size: float) -> Callable[[Primitive], Primitive]:
    return lambda p: replace(p, size=size)


def _at(x: float, y: float, z: float) -> Callable[[Primitive], Primitive]:
    return lambda p: replace(p, center=(x, y, z))


def _without_hole(program: Program) -> Program:
    """The bracket with three of its four holes."""
    plate, boss, *holes, bore = leaves(program)
    out: Program = Combine("union", plate, boss)
    for cutter in (*holes[:3], bore):
        out = Combine("difference", out, cutter)
    return out


def _without_rib(program: Program) -> Program:
    base, wall, rib, _, hole = leaves(program)
    return Combine("difference", Combine("union", Combine("union", base, wall), rib), hole)


def _in_inches(program: Program) -> Program:
    def shrink(length: float) -> float:
        return length / INCH

    return map_leaves(program, lambda _, p: map_lengths(p, shrink, tuple(map(shrink, p.center))))  # type: ignore[arg-type]


MISTAKES: Mapping[str, SeededMistake] = {
    "a missed hole": SeededMistake(BRACKET, _without_hole(BRACKET)),
    "a wrong diameter": SeededMistake(FLANGE, _with(FLANGE, {8: _sized(8.0, 80.0)})),
    "a lost tie": SeededMistake(BRACKET, _with(BRACKET, {4: _sized(3.4, 20.0)})),
    "a wrong unit": SeededMistake(LEVER, _in_inches(LEVER)),
    "a blind hole": SeededMistake(BRACKET, _with(BRACKET, {6: lambda p: replace(p, size=(8.0, 40.0), center=(0.0, 0.0, 20.0))})),
    "a moved boss": SeededMistake(BRACKET, _with(BRACKET, {1: _at(4.0, -3.0, 8.0)})),
    "an extra feature": SeededMistake(FLANGE, Combine("union", FLANGE, Primitive("cylinder", (5.0, 14.0), (0.0, -30.0, 5.0)))),
    "a wrong thickness": SeededMistake(ANGLE, _with(ANGLE, {0: _sized(60.0, 40.0, 4.0)})),
    "a missing rib": SeededMistake(ANGLE, _without_rib(ANGLE)),
    "a wrong spacing": SeededMistake(
        BRACKET,
        _with(
            BRACKET, {i: _at(28.0 * x, 17.0 * y, 0.0) for i, (x, y) in zip(range(2, 6), ((-1, -1), (-1, 1), (1, -1), (1, 1)), strict=True)}
        ),
    ),
}
