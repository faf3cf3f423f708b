"""Do the stated 95 % intervals hold, and are rounded numbers the right ones? On planted parts, whose numbers are known.

    python scripts/bench/intervals.py --parts 20 --noise 0.3,0.5,1 --out out/intervals
    python scripts/bench/intervals.py --parts 60 --given            # the structure is given, its numbers are not: many parts, quickly
    python scripts/bench/intervals.py --grid 0.1                    # parts with finer numbers than multiples of 0.5

Each part (`planting.planted`, one to four primitives) is scanned with Gaussian noise and reconstructed. A name of the result is compared
with the part where the primitives that it is read from have one of the same kind and direction beside them; the others are counted as
"no such dimension". A name is wrongly snapped where it is called snapped and is not the part's number.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh
from planting import planted, write_csv
from processor import CLOCKS, rule_the_clock

import imdim
from imdim.delivery.finish import FinishedProgram, finish
from imdim.delivery.intervals import NameReadings, StatedInterval, state_intervals
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.numbers.design_values import row_of
from imdim.numbers.em import maximise_likelihood
from imdim.numbers.likelihood import Noise
from imdim.numbers.symmetry_normal_form import canonical
from imdim.program.motions import is_round
from imdim.program.tree import Primitive, Program, leaves, map_leaves
from imdim.reconstruction.fitting import find_relations, snap_measured
from imdim.reconstruction.observation import UnitBody, observe
from imdim.relations.discover import discover
from imdim.target.scan import Condition, scan
from imdim.target.target import Target, in_unit_frame, target_from

BESIDE = 0.05  # of the part's diagonal, within which a primitive of the part has to be
ALONG = 0.99  # cosine between directions
SAME = 1e-6  # by which a number is another
SEGMENTS = 720  # of a circle
SHAKE = 0.004  # of the diagonal, by which given numbers are moved


@dataclass
class Row:
    """A name of one reconstruction; `truth` is nan where the part has no such dimension."""

    part: int
    noise: float
    name: str
    value: float
    measured: float
    half: float
    truth: float
    snapped: bool

    @property
    def is_known(self) -> bool:
        """Whether the part has this dimension."""
        return bool(np.isfinite(self.truth))

    @property
    def holds(self) -> bool:
        """Whether the interval holds the part's number."""
        return abs(self.measured - self.truth) <= self.half

    @property
    def is_wrong(self) -> bool:
        """Whether it was snapped to another number than the part's."""
        return self.snapped and abs(self.value - self.truth) > SAME * max(1.0, abs(self.truth))


def main() -> None:
    """Measure what the command line asks for, and print one line per noise."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", type=int, default=20)
    parser.add_argument("--noise", default="0.3,0.5,1", help="per cent of the diagonal, joined by commas")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--budget", type=float, default=30.0)
    parser.add_argument("--grid", type=float, default=0.5, help="the parts' numbers are multiples of it")
    parser.add_argument("--given", action="store_true", help="the structure is given")
    parser.add_argument("--clock", choices=CLOCKS, default="processor")
    parser.add_argument("--out", type=Path, default=Path("out/intervals"))
    given = parser.parse_args()
    if given.clock == "processor":
        rule_the_clock()
    given.out.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    for noise in map(float, given.noise.split(",")):
        for number in range(given.parts):
            rng = np.random.default_rng([given.seed, number])
            part = _regrid(planted(rng, 1 + number % 4), given.grid, rng)
            points, _ = scan(_mesh_of(part), Condition(noise=noise / 100), rng)
            target = target_from(points, f"part {number}")
            found = _shaken(part, target, rng) if given.given else _reconstructed(target, given.budget)
            rows += _rows(number, noise, part, found, state_intervals(found, target))
            print(_line([r for r in rows if r.noise == noise]), flush=True)
        write_csv(rows, given.out / "intervals.csv")
    for noise in sorted({r.noise for r in rows}):
        print(_line([r for r in rows if r.noise == noise]))
    print("all:", _line(rows))


def _mesh_of(part: Program) -> trimesh.Trimesh:
    """The part with circles so fine that their chords lie within the narrowest interval."""
    return to_trimesh(to_manifold(part, SEGMENTS))


def _regrid(part: Program, grid: float, rng: np.random.Generator) -> Program:
    """The part with numbers that are multiples of another grid."""
    if grid == 0.5:
        return part

    def moved(values: tuple[float, ...], least: float) -> tuple[float, ...]:
        return tuple(max(round((v + rng.uniform(-0.5, 0.5)) / grid) * grid, least) for v in values)

    return map_leaves(part, lambda _, p: replace(p, size=moved(p.size, grid), center=moved(p.center, -np.inf)))  # type: ignore[arg-type]


def _reconstructed(target: Target, budget: float) -> FinishedProgram:
    result = imdim.reconstruct(target, imdim.Settings(budget_s=budget))
    return finish(result.program, result.constraints)


def _shaken(part: Program, target: Target, rng: np.random.Generator) -> FinishedProgram:
    """The part's own structure with its numbers found anew, as the pipeline finds them, from wrong ones."""
    unit, frame = in_unit_frame(target)
    seen = observe(UnitBody.of(unit, rng), 2.5e-4, rng)
    start = map_leaves(
        frame.apply(part),
        lambda _, p: replace(
            p,
            size=tuple(s + rng.normal(0, SHAKE) for s in p.size),
            center=tuple(c + rng.normal(0, SHAKE) for c in p.center),  # type: ignore[arg-type]
            rotation=tuple(r + rng.normal(0, 0.5) for r in p.rotation),  # type: ignore[arg-type]
        ),
    )
    likely = maximise_likelihood(start, seen.target.points, Noise(seen.noise.sigma))
    related = discover(map_leaves(likely.program, lambda _, p: canonical(p)), seen.target.points, noise=likely.noise.sigma)
    found = [replace(c, value=c.value / frame.scale) for c in related.constraints]
    program = snap_measured(frame.undo(related.program), found, frame.to_world(seen.target.points))
    return finish(*find_relations(program, target, found))


def _rows(number: int, noise: float, part: Program, found: FinishedProgram, stated: dict[str, StatedInterval]) -> Iterator[Row]:
    readings = NameReadings.of(found)
    if readings is None:
        return
    own, start = list(leaves(part)), readings.start
    length = float(np.linalg.norm(np.ptp(_mesh_of(part).vertices, axis=0)))
    moves, unknown = np.zeros(start.count), np.ones(start.count, bool)
    for i, leaf in enumerate(leaves(found.program)):
        offers = [row_of(p) - row_of(leaf) for p in map(canonical, own) if _is_alike(canonical(leaf), p)]
        best = min(offers, key=lambda off: float(np.abs(off).max()), default=None)
        if best is not None:
            moves[9 * i : 9 * i + 3], moves[9 * i + 3 : 9 * i + 6] = best[:3], start.numbers.rotations[i].T @ best[3:]
            unknown[9 * i : 9 * i + 9] = False
    for name, slope in zip(found.parameters.values, readings.slopes, strict=True):
        if name in stated:
            it, move = stated[name], float(slope @ moves)
            beside = not slope[unknown].any() and abs(move) <= BESIDE * length
            yield Row(number, noise, name, it.value, it.measured, it.half, it.value + move if beside else np.nan, it.snapped)


def _is_alike(leaf: Primitive, other: Primitive) -> bool:
    """Whether two leaves are of one kind and look one way."""
    a, b = matrix_from_euler(leaf.rotation), matrix_from_euler(other.rotation)
    turned = abs(a[:, 2] @ b[:, 2]) if is_round(leaf) else min(np.abs(np.diagonal(a.T @ b)))
    return leaf.kind == other.kind and (leaf.kind == "sphere" or float(turned) > ALONG)


def _line(rows: list[Row]) -> str:
    known = [r for r in rows if r.is_known]
    snapped = [r for r in known if r.snapped]
    share = sum(r.holds for r in known) / max(len(known), 1)
    wrong = sum(r.is_wrong for r in snapped)
    noise = ", ".join(f"{n:g} %" for n in sorted({r.noise for r in rows}))
    width = float(np.median([r.half for r in known])) if known else np.nan
    return (
        f"noise {noise}: {len({r.part for r in rows})} parts, {len(known)} names, intervals hold {share:.1%} (median +- {width:.3f}); "
        f"{len(snapped)} snapped, {wrong} wrong; {len(rows) - len(known)} no such dimension"
    )


if __name__ == "__main__":
    main()
