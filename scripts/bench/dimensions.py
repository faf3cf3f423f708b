"""Change each dimension of planted designs, and ask whether one name of the program that was found does the same.

    python scripts/bench/dimensions.py [--parts 40] [--seed 0] [--out out/dimensions] [--budget 60] [--clock wall] [--only 3,17]

The parts are those of `designs.py`, whose dimensions and datums are known; some are laid on another side. They are fitted with the default
settings into the folder, one folder a part; parts that are there already are scored alone.

A dimension, made a tenth larger, changes the designed solid; it is left out where that moves less than 0.05 % of the volume. It is right if
one name of ours, changed by as much, by half of that or twice that (radius and diameter, place and spacing), either way, gives a solid of
IoU 0.995 or more with the designed one, and of all that was to move at most a fifth is off. A shift of the whole part is no difference,
but is counted. With ``near`` a dimension has a name of its value, its half or its double.
"""

from __future__ import annotations

import itertools
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from designs import Design, design
from holes import fit
from manifold3d import Manifold
from planted_parts import asked_parts

GROWN = 0.1
LEAST = 5e-4  # of the volume, that an edit has to move
SAME = 0.995
OFF = 0.2  # of what an edit moves
SHARES = (1.0, 2.0, 0.5, -1.0, -2.0, -0.5)
NEAR = 0.01
PLACED = 1e-3  # of the size of a part, from which on a shift is counted


def main() -> None:
    rows: list[dict[str, Any]] = []
    for rng, number, folder, budget, _ in asked_parts(__doc__, Path("out/dimensions")):
        made, turn = design(rng, number), _turn(rng)
        if not (folder / "program.json").exists():
            fit(made.build(made.values).transform(turn), folder, budget)
        found = list(score(folder, made, turn))
        rows += found
        wrong = [f"{r['dimension']}{'' if r['near'] else ' unnamed'}" for r in found if not r["right"]]
        kind = made.build.__name__.strip("_")
        print(
            f"{folder.name} {kind}: {sum(r['right'] for r in found)} of {len(found)}" + (": " if wrong else "") + ", ".join(wrong),
            flush=True,
        )
    print(totals(rows))


def totals(rows: Sequence[dict[str, Any]]) -> str:
    """Shares of all dimensions, and of those of each kind that is wrong anywhere."""
    n = max(len(rows), 1)
    right, near, moved = (sum(r[key] for r in rows) for key in ("right", "near", "moved"))
    lines = [
        f"{len(rows)} dimensions: right {100 * right / n:.1f} % ({moved} of them with the whole part moved), named {100 * near / n:.1f} %"
    ]
    kinds: dict[str, Counter[bool]] = defaultdict(Counter)
    for row in rows:
        kinds[f"{row['kind']} {row['dimension']}"][row["right"]] += 1
    lines += [f"  {kind}: {c[True]} of {c.total()}" for kind, c in sorted(kinds.items(), key=lambda kc: -kc[1][False]) if c[False]]
    return "\n".join(lines)


def score(folder: Path, made: Design, turn: np.ndarray) -> Iterator[dict[str, Any]]:
    """One row a dimension."""
    from imdim.app.edit import open_results
    from imdim.geometry.solid import to_manifold

    delivered = open_results(folder / "program.json")
    before = made.build(made.values).transform(turn)
    apart = _apart(to_manifold(delivered.program, delivered.segments), before)
    for dimension, value in made.values.items():
        after = made.build(made.values | {dimension: value * (1 + GROWN)}).transform(turn)
        change = _apart(before, after)
        if change < LEAST * before.volume():
            continue
        room = OFF * change + apart
        off, iou, shift, by = min(_edits(delivered, value * GROWN, after, room), default=(apart + change, 0.0, 0.0, ""))
        off = max(off - apart, 0.0) / change
        right = iou >= SAME and off <= OFF
        yield {
            "kind": made.build.__name__.strip("_"),
            "dimension": dimension,
            "near": any(abs(v - value * k) <= NEAR * value * k for v in delivered.values.values() for k in (0.5, 1.0, 2.0)),
            "right": right,
            "moved": bool(right and shift > PLACED * np.ptp(_bounds(before), 0).max()),
            "off": off,
            "by": by,
        }


def _edits(delivered: Any, step: float, after: Manifold, room: float) -> Iterator[tuple[float, float, float, str]]:
    """For each name and share of the step the volume that is off, the IoU, by how much the part had to be shifted, and the edit; without
    those whose volume alone is off by more than there is `room` for."""
    from imdim.export.delivered import read
    from imdim.geometry.solid import to_manifold

    wanted, bounds = after.volume(), _bounds(after)
    for (name, old), share in itertools.product(delivered.values.items(), SHARES):
        try:
            edited = to_manifold(read(delivered, {name: old + share * step}), delivered.segments)
        except ValueError:
            continue
        shift = (bounds - _bounds(edited)).mean(0)
        if abs(edited.volume() - wanted) > room or np.abs(bounds - _bounds(edited) - shift).max() > NEAR * np.ptp(bounds, 0).max():
            continue
        placed = edited.translate(tuple(shift))
        both = (placed ^ after).volume()
        off = placed.volume() + wanted - 2 * both
        yield off, both / (both + off), float(np.abs(shift).max()), f"{name} {share * step:+g}"


def _apart(a: Manifold, b: Manifold) -> float:
    return a.volume() + b.volume() - 2 * (a ^ b).volume()


def _bounds(solid: Manifold) -> np.ndarray:
    return np.array(solid.bounding_box()).reshape(2, 3)


def _turn(rng: np.random.Generator) -> np.ndarray:
    """Two of three parts lie as they were drawn, the others on a side."""
    turns = np.array([np.eye(3), np.eye(3), [[0, 0, 1], [1, 0, 0], [0, 1, 0]]], float)
    return np.column_stack([turns[int(rng.integers(3))], np.zeros(3)])


if __name__ == "__main__":
    main()
