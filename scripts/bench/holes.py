"""Plant parts with holes of all kinds, fit them, and ask whether the holes come back: kind, axis, sizes, and through where they go through.

    python scripts/bench/holes.py [--parts 40] [--seed 0] [--out out/holes] [--budget 60] [--clock wall] [--only 3,17]

Parts are about 100 long and made by manifold3d alone: plates, discs, brackets and blocks with one or two groups of holes, which are
through, blind, counterbored, countersunk, drilled with a point, or hexagonal pockets, one by one, in rows, in grids and on circles; some
parts are turned, one in eight by an odd angle. They are fitted with the default settings into the folder, one folder a part; parts that
are there already are scored alone.

A hole is found if the program has one on its axis, within 0.05 all along the part. Its kind is right, or not; its sizes are if all are
within 1 %. What the program calls a hole where none was planted is counted too. Then the body is made half as thick again by the name that
is its thickness: a through hole stays through if what was found of it is through after that, wherever it moved with its body.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from manifold3d import CrossSection, Manifold, OpType
from planted_parts import asked_parts

KINDS = ("through", "blind", "counterbore", "countersink", "drilled", "hex pocket")
NEAR = 0.05  # of a part of 100
SIZES = 0.01
THICKER = 1.5
SEGMENTS = 96
POINT_DEG = 118.0
SCREWS = {  # medium clearance, head of a socket screw and its height, head of a countersunk one, tap drill, nut across flats and its height
    3: (3.4, 6.5, 3.0, 6.72, 2.5, 5.5, 2.4),
    4: (4.5, 8.0, 4.0, 8.96, 3.3, 7.0, 3.2),
    5: (5.5, 10.0, 5.0, 11.2, 4.2, 8.0, 4.7),
    6: (6.6, 11.0, 6.0, 13.44, 5.0, 10.0, 5.2),
}


@dataclass(frozen=True)
class PlantedHole:
    """`point` on the face that the hole enters, unit `direction` into it; `sizes` are its diameters, of a pocket the width across flats."""

    kind: str
    through: bool
    point: tuple[float, ...]
    direction: tuple[float, ...]
    sizes: tuple[float, ...]


def main() -> None:
    rows = []
    for rng, number, folder, budget, _ in asked_parts(__doc__, Path("out/holes")):
        solid, holes, thickness = plant(rng, number)
        if not (folder / "program.json").exists():
            fit(solid, folder, budget)
        row = score(folder, holes, thickness)
        rows.append(row)
        print(f"{folder.name}: " + ", ".join(f"{k} {v}" for k, v in row.items() if v not in (0, [], None)), flush=True)
    print(totals(rows))
    wrong = Counter(w for row in rows for w in row["wrong"])
    print("\n".join(f"  {what}: {n}" for what, n in wrong.most_common()))


def totals(rows: Sequence[dict[str, Any]]) -> str:
    """The counts of all parts as shares, in a line."""
    keys = ("holes", "found", "kind", "sizes", "strange", "through", "stayed", "unnamed")
    n = {key: sum(row[key] for row in rows) for key in keys}
    right = ", ".join(f"{what} {_share(n[key], n['holes'])}" for what, key in (("axis", "found"), ("kind", "kind"), ("sizes", "sizes")))
    stay = f"{_share(n['stayed'], n['through'])} of {n['through']} stay through, {n['unnamed']} parts without a thickness"
    return f"{len(rows)} parts, {n['holes']} holes: {right}, strange {n['strange']}; {stay}"


def _share(part: int, whole: int) -> str:
    return f"{100 * part / max(whole, 1):.1f} %"


# --- parts --------------------------------------------------------------------------------------------------------------


def plant(rng: np.random.Generator, number: int) -> tuple[Manifold, list[PlantedHole], float]:
    """A part, its holes, and how thick it is; the kinds take turns."""
    first, second = KINDS[number % len(KINDS)], KINDS[(number + 1 + number // len(KINDS)) % len(KINDS)]
    body, thickness, places = BODIES[number % len(BODIES)](rng)
    cutters, holes = [], []
    for kind, (through, points, direction) in zip((first, second), places, strict=False):
        screw = int(rng.choice(list(SCREWS)))
        is_metric = rng.random() < 0.7
        cutter, sizes, open_ended = cut(kind, through, screw, is_metric, rng)
        turn = _turn_to(direction)
        for point in points:
            cutters.append(cutter.transform(np.column_stack([turn, point])))
            holes.append(PlantedHole(kind, open_ended, tuple(point), tuple(direction), sizes))
    solid = Manifold.batch_boolean([body, *cutters], OpType.Subtract)
    placement = np.column_stack([_turn(rng, number), rng.integers(-40, 40, 3).astype(float)])
    return solid.transform(placement), [_moved(hole, placement) for hole in holes], thickness


def cut(kind: str, thickness: float, screw: int, is_metric: bool, rng: np.random.Generator) -> tuple[Manifold, tuple[float, ...], bool]:
    """A cutter that enters at z = 0 and runs down; its sizes, and whether it goes through `thickness`."""
    clearance, head, head_height, sunk, drill, flats, nut = SCREWS[screw]
    if not is_metric:
        scale = float(rng.uniform(0.85, 1.2))
        clearance, head, sunk, drill, flats = (round(v * scale, 1) for v in (clearance, head, sunk, drill, flats))
    deep = min(round(float(rng.uniform(0.45, 0.7)) * thickness, 1), thickness - 1.5)
    head_height, nut = min(head_height, thickness / 2), min(nut, thickness / 2)
    if kind == "through":
        return _rod(clearance, -thickness - 1), (clearance,), True
    if kind == "blind":
        return _rod(clearance, -deep), (clearance,), False
    if kind == "drilled":
        tip = drill / 2 / math.tan(math.radians(POINT_DEG / 2))
        return _rod(drill, -deep + tip) + _cone(0.0, drill, -deep, tip), (drill,), False
    narrow = _rod(clearance, -thickness - 1)
    if kind == "counterbore":
        return narrow + _rod(head, -head_height), (clearance, head), True
    if kind == "countersink":
        depth = (sunk - clearance) / 2
        return narrow + _cone(clearance, sunk, -depth, depth) + _rod(sunk, 0.0), (clearance, sunk), True
    hexagon = CrossSection.circle(flats / math.sqrt(3), 6).extrude(nut + 1).translate((0.0, 0.0, -nut))
    return narrow + hexagon, (clearance, flats), True


def _rod(diameter: float, low: float) -> Manifold:
    return Manifold.cylinder(1 - low, diameter / 2, diameter / 2, SEGMENTS).translate((0.0, 0.0, low))


def _cone(bottom: float, top: float, low: float, height: float) -> Manifold:
    return Manifold.cylinder(height, bottom / 2, top / 2, SEGMENTS).translate((0.0, 0.0, low))


Places = list[tuple[float, list[tuple[float, float, float]], tuple[float, float, float]]]  # thickness, points, direction

DOWN = (0.0, 0.0, -1.0)


def plate(rng: np.random.Generator) -> tuple[Manifold, float, Places]:
    """A grid of four, and one or three along the middle; the corners may be round."""
    t = float(rng.choice([8.0, 10.0, 12.0]))
    if rng.random() < 0.5:
        body = Manifold.cube((100.0, 60.0, t)).translate((-50.0, -30.0, 0.0))
    else:
        body = CrossSection.square((88.0, 48.0), True).offset(6.0, circular_segments=SEGMENTS).extrude(t)
    dx, dy = 5.0 * int(rng.integers(13, 17)), 5.0 * int(rng.integers(6, 9))
    corners = [(x * dx / 2, y * dy / 2, t) for x in (-1, 1) for y in (-1, 1)]
    middle = [(18.0 * k, 0.0, t) for k in ((-1, 0, 1) if rng.random() < 0.5 else (0,))]
    return body, t, [(t, corners, DOWN), (t, middle, DOWN)]


def disc(rng: np.random.Generator) -> tuple[Manifold, float, Places]:
    """A circle of holes, and one in the middle."""
    t = float(rng.choice([8.0, 10.0, 12.0]))
    count, radius = int(rng.integers(3, 8)), 5.0 * int(rng.integers(6, 8))
    body = Manifold.cylinder(t, 50.0, 50.0, SEGMENTS)
    angles = [2 * math.pi * k / count for k in range(count)]
    round_about = [(radius * math.cos(a), radius * math.sin(a), t) for a in angles]
    return body, t, [(t, round_about, DOWN), (t, [(0.0, 0.0, t)], DOWN)]


def bracket(rng: np.random.Generator) -> tuple[Manifold, float, Places]:
    """Holes in both legs."""
    t = float(rng.choice([8.0, 10.0]))
    body = Manifold.cube((100.0, 50.0, t)).translate((-50.0, -50.0, 0.0)) + Manifold.cube((100.0, t, 60.0)).translate((-50.0, -t, 0.0))
    dx = 5.0 * int(rng.integers(12, 16))
    foot = [(x * dx / 2, y, t) for x in (-1, 1) for y in (-40.0, -22.0)]
    wall = [(x * 25.0, -t, 40.0) for x in (-1, 1)]
    return body, t, [(t, foot, DOWN), (t, wall, (0.0, 1.0, 0.0))]


def block(rng: np.random.Generator) -> tuple[Manifold, float, Places]:
    """A row from above, and two holes from the side between them."""
    t = float(rng.choice([20.0, 25.0]))
    body = Manifold.cube((100.0, 40.0, t)).translate((-50.0, -20.0, 0.0))
    row = [(30.0 * k, 0.0, t) for k in (-1, 0, 1)]
    side = [(x * 15.0, -20.0, t / 2) for x in (-1, 1)]
    return body, t, [(t, row, DOWN), (40.0, side, (0.0, 1.0, 0.0))]


def stepped(rng: np.random.Generator) -> tuple[Manifold, float, Places]:
    """A flange with a boss in its middle, which a hole goes into."""
    t, high = float(rng.choice([8.0, 10.0])), float(rng.choice([20.0, 25.0]))
    body = Manifold.cube((100.0, 70.0, t)).translate((-50.0, -35.0, 0.0)) + Manifold.cylinder(high, 18.0, 18.0, SEGMENTS)
    corners = [(x * 40.0, y * 25.0, t) for x in (-1, 1) for y in (-1, 1)]
    return body, t, [(t, corners, DOWN), (high, [(0.0, 0.0, high)], DOWN)]


BODIES = (plate, disc, bracket, block, stepped)


def _turn(rng: np.random.Generator, number: int) -> np.ndarray:
    """Every second part as it was drawn, one in eight by an odd angle, the others by right angles."""
    if number % 8 == 7:
        return trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
    turns = np.array([np.eye(3), [[0, 0, 1], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [0, 0, -1], [0, 1, 0]]], float)
    return turns[0 if number % 2 == 0 else int(rng.integers(1, 3))]


def _turn_to(direction: tuple[float, ...]) -> np.ndarray:
    """A rotation that takes -z to `direction`."""
    z = -np.array(direction)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    return np.column_stack([x, np.cross(z, x), z])


def _moved(hole: PlantedHole, placement: np.ndarray) -> PlantedHole:
    turn, shift = placement[:, :3], placement[:, 3]
    point, direction = turn @ np.array(hole.point) + shift, turn @ np.array(hole.direction)
    return PlantedHole(hole.kind, hole.through, tuple(point.tolist()), tuple(direction.tolist()), hole.sizes)


# --- fits and scores ----------------------------------------------------------------------------------------------------


def fit(solid: Manifold, folder: Path, budget_s: float) -> None:
    """As `imdim fit` does it."""
    from imdim.app.cli import main as imdim

    folder.parent.mkdir(parents=True, exist_ok=True)
    source = folder.with_suffix(".stl")
    mesh = solid.to_mesh64()
    trimesh.Trimesh(np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts, np.int64)).export(source)
    imdim(["fit", str(source), "-o", str(folder), "--budget", str(budget_s)])


def score(folder: Path, planted: list[PlantedHole], thickness: float) -> dict[str, Any]:
    """What of the planted holes came back, in counts; `wrong` says what those of other kinds are called."""
    found = _found(json.loads((folder / "program.json").read_text()))
    row: dict[str, Any] = {"holes": len(planted), "found": 0, "kind": 0, "sizes": 0, "wrong": []}
    used: dict[int, PlantedHole] = {}
    for hole in planted:
        near = [i for i, f in enumerate(found) if i not in used and _apart(hole, f) <= NEAR]
        best = min(near, key=lambda i: (found[i]["kind"] != hole.kind, _apart(hole, found[i])), default=None)
        if best is None:
            row["wrong"].append(f"{hole.kind} not found")
            continue
        used[best] = hole
        its = found[best]
        right = its["kind"] == hole.kind and its["through"] == hole.through
        row["found"] += 1
        row["kind"] += right
        row["sizes"] += right and len(its["sizes"]) == len(hole.sizes) and np.allclose(its["sizes"], hole.sizes, rtol=SIZES)
        row["wrong"] += [] if right else [f"{hole.kind} is {its['kind']}{' through' if its['through'] else ''}"]
    row["strange"] = len(found) - len(used)
    through = [tuple(found[i]["leaves"]) for i, hole in used.items() if hole.through]
    return row | _thicken(folder, through, sum(hole.through for hole in planted), thickness)


def _found(document: Any) -> list[dict[str, Any]]:
    from imdim.geometry.holes import find_holes
    from imdim.program.codec import from_json

    return [asdict(h) | {"kind": h.kind, "sizes": h.diameters, "leaves": h.leaves} for h in find_holes(from_json(document))]


def _apart(hole: PlantedHole, found: dict[str, Any]) -> float:
    """How far the two axes are apart at most within 50 of the planted hole; only what goes through both ways may run the other way."""
    a, d = np.array(hole.point), np.array(hole.direction)
    p, e = np.array(found["point"]), np.array(found["direction"])
    if abs(d @ e) < 0.9 or (d @ e < 0 and not (hole.through and found["through"])):
        return math.inf
    ends = np.array([a - 50 * d, a + 50 * d]) - p
    return float(np.linalg.norm(ends - np.outer(ends @ e, e), axis=1).max())


def _thicken(folder: Path, found: list[tuple[int, ...]], planted: int, thickness: float) -> dict[str, Any]:
    """Of the `planted` through holes how many stay so, by the primitives of those `found`; parts without a name for the thickness are
    counted."""
    from imdim.app.edit import open_results
    from imdim.export.edit import EditError, change_values
    from imdim.geometry.holes import find_holes

    delivered = open_results(folder / "program.json")
    names = [
        n
        for n, v in delivered.values.items()
        if abs(v - thickness) < 1e-3 and n.split("_")[-1] in ("thickness", "height", "length", "width")
    ]
    for name in names if planted else ():
        try:
            edited = change_values(delivered, {name: thickness * THICKER})
        except EditError:
            continue
        left = Counter(hole.leaves for hole in find_holes(edited.program) if hole.through)
        stayed = sum((left & Counter(found)).values())
        return {"through": planted, "stayed": stayed, "unnamed": 0}
    return {"through": 0, "stayed": 0, "unnamed": int(planted > 0)}


if __name__ == "__main__":
    main()
