"""Plant parts whose walls have a draft, fit them, and ask whether the angles and the features come back.

    python scripts/bench/drafts.py [--parts 24] [--seed 0] [--out out/drafts] [--budget 60] [--clock wall] [--only 3,17]

Parts are about 80 long: a block on a plate, a hexagonal knob, a rounded tray, pockets in a mould, an angle with a hole, a dish with round
ends. Their drafts are 1 to 15 degrees, in halves; one part in four is turned by odd angles. They are fitted with the default settings into
the folder, one folder a part; parts that are there already are scored alone.

A part is found if its program has the drafts that were planted, to 0.05 degrees, an IoU with it of 0.999, and no more features than the
design, copies read once. Each part that ends with another exit status than 0 counts as failed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from lettering import fit
from planted_parts import asked_parts

from imdim.geometry.finish.extend import between
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.program.codec import from_json, parse
from imdim.program.motions import Motion, move_program
from imdim.program.outline import Loop, Outline
from imdim.program.patterns.weigh import take_first_copies
from imdim.program.tree import Primitive, Program, Vec3, combine_all, leaves
from imdim.target.target import as_matrix

NEAR_DEG = 0.05
SAME = 0.999  # of volume IoU
QUARTER = math.tan(math.pi / 8)  # the bulge of a quarter arc


def main() -> None:
    rows = []
    for rng, number, folder, budget, _ in asked_parts(__doc__, Path("out/drafts"), parts=24):
        program = plant(rng, number)
        if not (folder / "fitted.json").exists():
            fit(to_manifold(program), folder, budget)
        rows.append(score(folder, program))
        print(f"{folder.name}: " + ", ".join(f"{k} {v:.6g}" for k, v in rows[-1].items()), flush=True)
    print(totals(rows))


def totals(rows: Sequence[dict[str, float]]) -> str:
    """The counts of all parts, in a line."""
    n = {key: sum(row[key] for row in rows) for key in rows[0]}
    seconds = float(np.median([row["seconds"] for row in rows]))
    said = f"{n['found']:.0f} found, {n['angles']:.0f} with all angles, {n['features']:.0f} features for {n['design']:.0f}"
    return f"{len(rows)} parts: {said}, mean IoU {n['iou'] / len(rows):.4f}, {n['failed']:.0f} failed, median {seconds:.1f} s"


# --- parts --------------------------------------------------------------------------------------------------------------


def plant(rng: np.random.Generator, number: int) -> Program:
    """A part; designs take turns."""
    program = DESIGNS[number % len(DESIGNS)](rng)
    if number % 4 != 3:
        return program
    turn = as_matrix(matrix_from_euler(tuple(rng.uniform(10, 80, 3).tolist())))
    x, y, z = rng.integers(-30, 30, 3).tolist()
    return move_program(program, Motion(turn, (float(x), float(y), float(z))))


def _whole(rng: np.random.Generator, low: int, high: int) -> float:
    return float(rng.integers(low, high))


def _angle(rng: np.random.Generator, most: float = 15.0) -> float:
    return float(rng.integers(2, 2 * most + 1)) / 2


def _drafted(height: float, draft: float, *loops: Loop, center: Vec3 = (0.0, 0.0, 0.0), widens: bool = False) -> Primitive:
    """Drawn at the lower end, or where it `widens` at the upper one."""
    return Primitive("drafted", (height, draft), center, (180.0, 0.0, 0.0) if widens else (0.0, 0.0, 0.0), Outline(loops))


def _pocket(height: float, draft: float, loop: Loop, x: float = 0.0) -> Primitive:
    """One that opens at z = 0, and goes on above: what ends flush leaves crumbs where a part is turned."""
    return between(_drafted(height, draft, loop, center=(x, 0.0, -height / 2), widens=True), (2, -1), -height, 1.0)


def _boss(height: float, draft: float, loop: Loop) -> Primitive:
    """One that stands at z = 0, and begins below."""
    return between(_drafted(height, draft, loop, center=(0.0, 0.0, height / 2)), (2, -1), -height, 1.0)


def _rectangle(x: float, y: float) -> Loop:
    return ((-x / 2, -y / 2, 0.0), (x / 2, -y / 2, 0.0), (x / 2, y / 2, 0.0), (-x / 2, y / 2, 0.0))


def _rounded(width: float, height: float, radius: float) -> Loop:
    x, y, a, b = width / 2, height / 2, width / 2 - radius, height / 2 - radius
    ends = [(-a, -y), (a, -y), (x, -b), (x, b), (a, y), (-a, y), (-x, b), (-x, -b)]
    return tuple((u, v, QUARTER if i % 2 else 0.0) for i, (u, v) in enumerate(ends))


def _slot(length: float, radius: float) -> Loop:
    x = length / 2
    return ((-x, -radius, 0.0), (x, -radius, 1.0), (x, radius, 0.0), (-x, radius, 1.0))


def _rod(radius: float, height: float, x: float = 0.0, y: float = 0.0) -> Primitive:
    return Primitive("cylinder", (radius, height), (x, y, 0.0))


def _block(rng: np.random.Generator) -> Program:
    x, y, z, high = _whole(rng, 60, 90), _whole(rng, 40, 60), _whole(rng, 5, 10), _whole(rng, 10, 20)
    plate = Primitive("box", (x, y, z), (0.0, 0.0, -z / 2))
    boss = _boss(high, _angle(rng), _rectangle(x - 24, y - 12))
    holes = [_rod(2.25, 4 * high, side * (x / 2 - 6)) for side in (-1, 1)]
    return combine_all("difference", [combine_all("union", [plate, boss]), *holes])


def _knob(rng: np.random.Generator) -> Program:
    r, z, high = _whole(rng, 16, 24), _whole(rng, 4, 8), _whole(rng, 10, 16)
    disc = Primitive("cylinder", (r + 10, z), (0.0, 0.0, -z / 2))
    corners = tuple((r * math.cos(math.pi * k / 3), r * math.sin(math.pi * k / 3), 0.0) for k in range(6))
    grip = _boss(high, _angle(rng, 10), corners)
    return combine_all("difference", [combine_all("union", [disc, grip]), _rod(4.0, 4 * high)])


def _tray(rng: np.random.Generator) -> Program:
    x, y, z, wall, draft = _whole(rng, 70, 90), _whole(rng, 45, 60), _whole(rng, 15, 24), _whole(rng, 2, 4), _angle(rng, 8)
    body = _drafted(z, draft, _rounded(x, y, 9.0), center=(0.0, 0.0, -z / 2), widens=True)
    deep = z - wall
    return combine_all("difference", [body, _pocket(deep, draft, _rounded(x - 2 * wall, y - 2 * wall, 9.0 - wall))])


def _mould(rng: np.random.Generator) -> Program:
    x, y, z, deep = _whole(rng, 90, 110), _whole(rng, 40, 60), _whole(rng, 20, 30), _whole(rng, 10, 16)
    draft, wide = _angle(rng, 12), _whole(rng, 28, 36)
    pockets = [_pocket(deep, draft, _rectangle(wide, y - 16), side * x / 4) for side in (-1, 1)]
    return combine_all("difference", [Primitive("box", (x, y, z), (0.0, 0.0, -z / 2)), *pockets])


def _bent(rng: np.random.Generator) -> Program:
    x, y, w, z = _whole(rng, 50, 70), _whole(rng, 40, 60), _whole(rng, 18, 24), _whole(rng, 10, 18)
    corners = ((0, 0), (x, 0), (x, w), (w, w), (w, y), (0, y))
    body = _drafted(z, _angle(rng, 8), tuple((u - x / 2, v - y / 2, 0.0) for u, v in corners))
    return combine_all("difference", [body, _rod(3.0, 4 * z, w / 2 - x / 2, w / 2 - y / 2)])


def _dish(rng: np.random.Generator) -> Program:
    apart, r, z, wall, draft = _whole(rng, 30, 50), _whole(rng, 20, 28), _whole(rng, 12, 18), _whole(rng, 2, 4), _angle(rng, 12)
    body = _drafted(z, draft, _slot(apart, r), center=(0.0, 0.0, -z / 2), widens=True)
    deep = z - wall
    return combine_all("difference", [body, _pocket(deep, draft, _slot(apart, r - wall)), _rod(2.5, 4 * z)])


DESIGNS = (_block, _knob, _tray, _mould, _bent, _dish)


# --- scores -------------------------------------------------------------------------------------------------------------


def score(folder: Path, planted: Program) -> dict[str, float]:
    """Whether the design came back, and how large the program is."""
    report, fitted = (json.loads((folder / name).read_text()) for name in ("report.json", "fitted.json"))
    program = from_json(parse((folder / "program.json").read_bytes()))
    features, design = (len(list(leaves(take_first_copies(p)[0]))) for p in (program, planted))
    found, wanted = ({leaf.size[1] for leaf in leaves(p) if leaf.kind == "drafted"} for p in (program, planted))
    iou = volume_iou(mesh_to_manifold(trimesh.load_mesh(folder / "mesh.stl")), to_manifold(planted))
    angles = all(any(abs(angle - other) <= NEAR_DEG for other in found) for angle in wanted)
    return {
        "found": angles and iou >= SAME and features <= design,
        "angles": angles,
        "failed": fitted["status"] != 0,
        "features": features,
        "design": design,
        "iou": iou,
        "mesh iou": report["scores"]["volume_iou"],
        "seconds": fitted["seconds"],
    }


if __name__ == "__main__":
    main()
