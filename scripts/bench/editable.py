"""Whether delivered programs read as a designer's: ``python scripts/bench/editable.py RESULTS [--sources TREES.json]``

RESULTS holds results folders. For each program.json: how many of its numbers (values of names as program.scad begins with them, lengths
and places that follow no name, angles; what is added to names is by how much cutters overshoot) lie on a grid of 0.05 mm, of a 64th of an
inch, or of 0.5 degrees; how many coefficients of expressions are neither multiples of 1/2 nor cosines of places on a circle; how deep its
operations nest, chains of one operation counted once; how many of its outlines have no number that follows no name
(`Parameters.free_numbers`); by how much the volume IoU of what was delivered is less than that of the program before delivery (of all,
the greatest loss); and how many bodies it has beyond those of the target, where the file that report.json calls its input is there: loose
crumbs, or parts that miss each other. Programs of parts in other units than millimetres or inches fail the first by design, and so do
those whose sources have other numbers: with the persons' programs, a JSON file of trees by part whose leaves are ["leaf", kind, numbers,
matrix], the last line is of the parts alone whose sources' numbers all lie on the grid. How many changes of names `imdim edit` accepts is
told by `edits.py`.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from imdim.export.delivered import read_values
from imdim.export.drawn_vertex import numbers_of
from imdim.export.numbers import Expression, angle_on_circle
from imdim.export.parameters import Parameters, parametrise
from imdim.geometry.census import census_of
from imdim.geometry.solid import mesh_to_manifold, to_manifold
from imdim.program.codec import constraints_of, from_json, parse, read_folded
from imdim.program.nary import fold_nary
from imdim.program.repeats import repeats
from imdim.program.tree import OPS, Program, leaves, longest
from imdim.target.target import load_target

GRIDS_MM = (0.05, 25.4 / 64)
GRID_DEG = 0.5
NEAR = 1e-5  # how far a number may lie from its grid: what files of single precision leave of it
ZERO = 1e-9


class Reading(NamedTuple):
    """Counts of one program."""

    numbers: int
    on_grid: int
    odd_coefficients: int
    depth: float
    outlines: int
    settled_outlines: int
    iou_loss: float | None = None
    crumbs: int | None = None

    def __str__(self) -> str:
        share = f" ({self.on_grid / self.numbers:.0%})" if self.numbers else ""
        cells = (self.numbers, f"{self.on_grid}{share}", self.odd_coefficients, f"{self.depth:g}", self.outlines, self.settled_outlines)
        loss = "-" if self.iou_loss is None else f"{self.iou_loss:.5f}"
        return " | ".join(map(str, (*cells, loss, "-" if self.crumbs is None else self.crumbs)))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("--sources", type=Path, help="the persons' programs")
    given = parser.parse_args()
    documents = sorted(given.results.glob("*/program.json"))
    if not documents:
        print(f"{given.results}: no folder in it has a program.json", file=sys.stderr)
        return 2
    readings = [read(path) for path in documents]
    print("| part | numbers | on the grid | other coefficients | nesting | outlines | without free numbers | IoU lost | crumbs |")
    print("| --- " * 9 + "|")
    for path, r in zip(documents, readings, strict=True):
        print(f"| {path.parent.name} | {r} |")
    print(f"| all {len(documents)} | {_sum_up(readings)} |")
    if given.sources:
        trees = json.loads(given.sources.read_text())
        regular = [
            r for path, r in zip(documents, readings, strict=True) if path.parent.name in trees and is_regular(trees[path.parent.name])
        ]
        print(f"| {len(regular)} whose sources are on the grid | {_sum_up(regular)} |")
    return 0


def _sum_up(readings: Sequence[Reading]) -> Reading:
    counts = Reading(*(sum(column) for column in zip(*(r[:6] for r in readings), strict=True)))
    losses = [r.iou_loss for r in readings if r.iou_loss is not None]
    crumbs = [r.crumbs for r in readings if r.crumbs is not None]
    depth = statistics.median(r.depth for r in readings)
    return counts._replace(depth=depth, iou_loss=max(losses, default=None), crumbs=sum(crumbs) if crumbs else None)


def is_regular(tree: Sequence[Any]) -> bool:
    """Whether all sizes of a person's program lie on the grid, and all places of what is not turned."""
    if tree[0] != "leaf":
        return all(map(is_regular, tree[1]))
    _, _kind, sizes, matrix = tree
    lengths = [x for size in sizes.values() for x in (size if isinstance(size, list) else [size]) if not isinstance(x, bool)]
    rows = [matrix[4 * i : 4 * i + 4] for i in range(3)]
    upright = all(math.isclose(abs(x), round(abs(x)), abs_tol=NEAR) for row in rows for x in row[:3])
    return all(_is_round(float(x), GRIDS_MM) for x in (*lengths, *((row[3] for row in rows) if upright else ())))


def read(path: Path) -> Reading:
    """Count what the texts of a program.json hold."""
    document = parse(path.read_bytes())
    program, folded = from_json(document), read_folded(document)
    named = parametrise(program, constraints_of(document), program, folded if any(repeats(folded)) else None)
    values = read_values((path.parent / "program.scad").read_text())
    on_grid = [*_lengths(named, values), *_angles(program, named)]
    coefficients = [float(t.coefficient) for e in _expressions(named) for t in e.terms]
    odd = sum(map(is_odd, coefficients))
    free = named.free_numbers(longest(leaves(program)))
    counts = Reading(len(on_grid), sum(on_grid), odd, nesting(program), len(free), free.count(0))
    return counts._replace(**_told_by_report(path.parent, program))


def _told_by_report(folder: Path, program: Program) -> dict[str, float | int | None]:
    """What can be said of a program beside its target; nothing without a report."""
    if not (folder / "report.json").exists():
        return {}
    report = json.loads((folder / "report.json").read_text())
    found, delivered = report["found"]["volume_iou"], report["scores"]["volume_iou"]
    loss = None if found is None or delivered is None else found - delivered
    return {"iou_loss": loss, "crumbs": _count_crumbs(program, Path(report["input"]))}


def _count_crumbs(program: Program, given: Path) -> int | None:
    """Bodies beyond those of the target; None where there is no solid to compare with."""
    target = load_target(given) if given.exists() else None
    if target is None or target.mesh is None or not target.is_solid:
        return None
    return max(0, census_of(to_manifold(program)).bodies - census_of(mesh_to_manifold(target.mesh)).bodies)


def is_odd(coefficient: float) -> bool:
    """Whether a coefficient is neither a multiple of 1/2 (of a row of four, one stands half a spacing off the middle, the last one 3/2)
    nor half a cosine."""
    return abs(2 * coefficient - round(2 * coefficient)) > ZERO and angle_on_circle(abs(coefficient)) is None


def nesting(program: Program) -> int:
    """How many operations lie about the deepest leaf; a union of three is one."""
    return fold_nary(program, lambda _i, _leaf: 0, dict.fromkeys(OPS, lambda depths: 1 + max(depths)))


def _expressions(named: Parameters) -> Iterator[Expression]:
    for rows in (named.sizes, named.centers):
        yield from (e for row in rows for e in row)
    yield from (number for loops in named.outlines for loop in loops for number in numbers_of(loop))


def _lengths(named: Parameters, values: Mapping[str, float]) -> Iterator[bool]:
    yield from (_is_round(values.get(name, v), GRIDS_MM) for name, v in named.values.items() if name not in named.angles)
    yield from (_is_round(e.constant, GRIDS_MM) for e in _expressions(named) if not e.terms and abs(e.constant) > ZERO)


def _angles(program: Program, named: Parameters) -> Iterator[bool]:
    yield from (_is_round(named.values[name], (GRID_DEG,)) for name in named.angles)
    turned = (r for p in leaves(program) for r in p.rotation)
    yield from (_is_round(r, (GRID_DEG,)) for r in turned if abs(r) > ZERO)


def _is_round(value: float, grids: tuple[float, ...]) -> bool:
    return any(abs(value - g * round(value / g)) <= NEAR for g in grids)


if __name__ == "__main__":
    sys.exit(main())
