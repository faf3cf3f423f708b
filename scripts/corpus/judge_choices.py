"""How often the form of a program is taken that is closer to the designer's, where plain features compete with drawings.

python scripts/corpus/judge_choices.py [--each 7]     # so many designs of each kind are fitted: two to four seconds of the processor each
python scripts/corpus/judge_choices.py --curve 0.1 0.33 [--each 1]     # as often for each of these prices of a curve in the search
Each decision between plainer features and what they stand for is watched. Of both programs it is known how many of their features have a
like one in the design: they explain the same points of the surface (Jaccard index of at least 0.8). A table says for each threshold of
`imdim.reconstruction.plain_program`, and for others in its place, how often the closer program is taken, and how much of the likeness is
lost where it is not; the last rows are of the description in bits in place of all thresholds, plain features having so many times as many.
With prices of a curve, it is the programs themselves that are compared with the designs.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import numpy as np
import trimesh
from count_prices import make_designs

import imdim
from imdim.geometry import kernels
from imdim.geometry.solid import to_manifold
from imdim.program.cost import CURVE_PRICES, count
from imdim.program.tree import Program, leaves
from imdim.reconstruction import methods, plain_program
from imdim.reconstruction.description import describe_bits
from imdim.reconstruction.design_events import PartBox
from imdim.reconstruction.observation import Observation

TRIALS = {
    "MORE": (1.0, 1.1, 1.15, 1.2, 1.25, 1.3, 1.5),
    "LESS": (0.7, 0.85, 1.0, 1.2),
    "FAR_LESS": (0.5, 0.65, 0.75, 0.85, 1.0),
    "SLIGHTLY": (0.7, 0.9, 1.1),
    "FEW": (8, 10, 12, 14, 16),
}
BITS = (1.0, 1.05, 1.1, 1.15, 1.2)
POINTS = 3000
NEAR = 2e-3  # of the part's diagonal, within which a feature explains a point
ALIKE = 0.8  # Jaccard index


class Decision(NamedTuple):
    """Plainer features and what they stand for, in the program of a part with `bounds` [2, 3], how alike both are to the design, and in how
    many bits each is described."""

    plain: Program
    drawn: Program
    bounds: np.ndarray
    plain_like: float
    drawn_like: float
    plain_bits: float
    drawn_bits: float


def watch_decisions(design: Program) -> Iterator[Decision]:
    """Fits the design's mesh."""
    asked: list[tuple[Program, Program, Observation]] = []
    decide = methods.is_plainer

    def watch(plain: Program, drawn: Program, seen: Observation) -> bool:
        asked.append((plain, drawn, seen))
        return decide(plain, drawn, seen)

    with mock.patch.object(methods, "is_plainer", watch):
        _, points, (low, high) = _fit(design)
    wanted = _explain(design, points, NEAR * float(np.linalg.norm(high - low)))
    for plain, drawn, seen in asked:
        first, last = seen.families.arrangement.part
        scale = float(np.linalg.norm(last - first) / np.linalg.norm(high - low))
        there = (points - (low + high) / 2) * scale + (first + last) / 2
        likes = (compare(_explain(program, there, NEAR * float(np.linalg.norm(last - first))), wanted) for program in (plain, drawn))
        bits = (describe_bits(program, PartBox(first, last, 1 / scale)) for program in (plain, drawn))
        yield Decision(plain, drawn, seen.families.arrangement.bounds, *likes, *bits)


def _fit(design: Program) -> tuple[Program, np.ndarray, np.ndarray]:
    """The program for the design's mesh, points [n, 3] of the surface of that, and its box [2, 3]."""
    made = to_manifold(design).to_mesh64()
    mesh = trimesh.Trimesh(made.vert_properties[:, :3], made.tri_verts, process=False)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "design.stl"
        mesh.export(path)
        found = imdim.reconstruct(path).program
    return found, np.asarray(trimesh.sample.sample_surface(mesh, POINTS, seed=0)[0]), np.asarray(mesh.bounds)


def judge_price(curve: float, each: int) -> tuple[float, int]:
    """How alike the programs are to their designs in the mean, at a price of a curve, and how many features they have."""
    likes, features = list[float](), 0
    with mock.patch.dict(CURVE_PRICES, description=curve):
        for design, part in make_designs(each):
            found, points, _ = _fit(design)
            likes.append(compare(*(_explain(program, points, NEAR * part.size) for program in (found, design))))
            features += count(found).primitives
    return sum(likes) / len(likes), features


def _explain(program: Program, points: np.ndarray, near: float) -> np.ndarray:
    """[leaves, n]: which leaf has which of points [n, 3] on its surface; leaves that have any."""
    on = np.array([np.abs(kernels.program_sdf(leaf, points)) <= near for leaf in leaves(program)])
    return on[on.any(axis=1)]


def compare(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Share of features of both programs that have a like one in the other: 2 n / (a + b) of n pairs."""
    if not len(ours) or not len(theirs):
        return 0.0
    common = ours.astype(float) @ theirs.T.astype(float)
    alike = common / (ours.sum(1)[:, None] + theirs.sum(1)[None] - common) >= ALIKE
    pairs, taken = 0, np.zeros(len(theirs), dtype=bool)
    for row in alike:
        free = np.flatnonzero(row & ~taken)
        if len(free):
            taken[free[0]] = True
            pairs += 1
    return 2 * pairs / (len(ours) + len(theirs))


def judge(decisions: list[Decision]) -> tuple[int, float]:
    """How many decisions are right with the thresholds as they are, and what likeness is lost by the others."""
    return _judge(decisions, lambda d: plain_program.is_hardly_longer(d.plain, d.drawn, *d.bounds))


def _judge(decisions: list[Decision], is_plain: Callable[[Decision], bool]) -> tuple[int, float]:
    lost = [abs(d.plain_like - d.drawn_like) for d in decisions if is_plain(d) != (d.plain_like > d.drawn_like)]
    return len(decisions) - len(lost), sum(lost)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--each", type=int, default=7, help="designs of each kind")
    parser.add_argument("--curve", type=float, nargs="+", default=(), help="prices of a curve, in primitives")
    given = parser.parse_args()
    for curve in given.curve:
        like, features = judge_price(curve, given.each)
        print(f"a curve at {curve}: {like:.3f} of the features are alike, {features} features", flush=True)
    if given.curve:
        return
    seen = [decision for design, _ in make_designs(given.each) for decision in watch_decisions(design)]
    telling = [decision for decision in seen if decision.plain_like != decision.drawn_like]
    print(f"{len(seen)} decisions, {len(telling)} between programs that are not alike to the design\n")
    print("| threshold | | right | lost |\n| --- | --- | --- | --- |")
    for name, values in TRIALS.items():
        own = getattr(plain_program, name)
        for value in values:
            with mock.patch.object(plain_program, name, value):
                right, lost = judge(telling)
            print(f"| {name} | {value}{' (own)' if value == own else ''} | {right} | {lost:.1f} |", flush=True)
    for times in BITS:
        right, lost = _judge(telling, lambda d, times=times: d.plain_bits <= times * d.drawn_bits)
        print(f"| bits | {times} | {right} | {lost:.1f} |", flush=True)


if __name__ == "__main__":
    main()
