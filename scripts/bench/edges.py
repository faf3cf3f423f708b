"""Plant parts with fillets and chamfers, fit them, and ask whether their edges come back: of the same kind and size, and no others.

    python scripts/bench/edges.py [--parts 40] [--seed 0] [--out out/edges] [--budget 60] [--clock wall] [--only 3,17] [--condition mesh]

Parts are about 60 long and made by OpenCASCADE (`pip install build123d`), blends included, and tessellated by it: plates with square and
with round corners, angles, plates with a boss, with a rib, with a pocket. One or two groups of edges are blended: the rim on top, both
rims, the foot of what stands on the plate, the mouth of the pocket, or all edges; one part in eight is turned by an odd angle. They are
fitted with the default settings into the folder, one folder a part; parts that are there already are scored alone.

A planted edge is found if the program has an edge feature of its kind along its middle, within 0.05, and its size is right if it is
within 2 %. Of noisy clouds (`--condition noise=0.5%`) an edge may be off by three deviations, and it is counted too how many stated
intervals of sizes hold. What the program blends where nothing was planted counts as strange, by the length of its edges.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchmark_part import sample
from planted_parts import AskedPart, asked_parts

NEAR = 0.05  # of a part of 60
SHAKEN = 3.0  # deviations of a scan's noise, if that is more
RIGHT = 0.02  # of a size
FINE = (0.01, 0.15)  # deflections of the tessellation: length and radians
SIZES = (0.4, 0.5, 0.8, 1.0, 1.5, 2.0, 3.0)
PLACES = 41  # along an edge


@dataclass(frozen=True)
class PlantedEdge:
    """`points` [PLACES, 3] along an edge that is blended."""

    kind: str
    size: float
    points: np.ndarray


def main() -> None:
    rows = []
    for asked in asked_parts(__doc__, Path("out/edges"), clouds=True):
        shape, edges = plant(asked.rng, asked.number)
        if not (asked.folder / "program.json").exists():
            fit(shape, asked)
        rows.append(score(asked, edges))
        print(f"{asked.folder.name}: " + ", ".join(f"{k} {v:.6g}" for k, v in rows[-1].items()), flush=True)
    print(totals(rows))


def totals(rows: Sequence[dict[str, float]]) -> str:
    """The counts of all parts as shares, in a line."""
    n = {key: sum(row[key] for row in rows) for key in rows[0]}
    recall, sizes = n["found"] / max(n["edges"], 1), n["right"] / max(n["found"], 1)
    precision = 1 - n["strange"] / max(n["length"], 1e-9)
    iou = np.mean([row["iou"] for row in rows])
    said = f"{len(rows)} parts, {n['edges']:.0f} edges: recall {recall:.3f}, precision {precision:.3f}, sizes {sizes:.3f}"
    if n["stated"]:
        said += f", {n['held']:.0f} of {n['stated']:.0f} intervals hold"
    return said if np.isnan(iou) else f"{said}, mean IoU {iou:.4f}"


# --- parts --------------------------------------------------------------------------------------------------------------


def plant(rng: np.random.Generator, number: int) -> tuple[Any, list[PlantedEdge]]:
    """A part as OpenCASCADE makes it, and its blended edges. Sizes that it cannot build are halved until it can."""
    import build123d as b

    body, groups = BODIES[number % len(BODIES)](b, rng)
    place = b.Location(tuple(rng.integers(-30, 30, 3).tolist()), (0.0, 0.0, float(rng.integers(5, 85)) if number % 8 == 7 else 0.0))
    planted: list[PlantedEdge] = []
    for name, chosen in list(groups.items())[: 1 + number % 2]:
        kind = ("chamfer", "fillet")[int(rng.integers(2))]
        size = float(rng.choice(SIZES if name != "all" else SIZES[:4]))
        edges = [edge for edge in body.edges() if chosen(edge)]
        while True:
            try:
                blended = b.chamfer(edges, size) if kind == "chamfer" else b.fillet(edges, size)
                if blended.is_valid and len(blended.solids()) == 1:
                    break
            except (ValueError, RuntimeError):
                pass
            size /= 2
        planted += [PlantedEdge(kind, size, _points(place, edge)) for edge in edges]
        body = blended
    return place * body, planted


def _points(place: Any, edge: Any) -> np.ndarray:
    moved = edge.moved(place)
    return np.array([tuple(moved.position_at(float(t))) for t in np.linspace(0, 1, PLACES)])


def _is_level(z: float) -> Any:
    return lambda edge: abs(edge.bounding_box().min.Z - z) < 1e-6 and abs(edge.bounding_box().max.Z - z) < 1e-6


def _plate(b: Any, rng: np.random.Generator, corner: float = 0.0) -> tuple[Any, float, tuple[float, float]]:
    x, y, z = (float(v) for v in (rng.integers(40, 60), rng.integers(25, 40), rng.integers(6, 12)))
    sketch = b.RectangleRounded(x, y, corner) if corner else b.Rectangle(x, y)
    return b.extrude(sketch, z), z, (x, y)


def _plain(b: Any, rng: np.random.Generator) -> tuple[Any, dict[str, Any]]:
    body, z, _ = _plate(b, rng)
    return body, {"top": _is_level(z), "bottom": _is_level(0.0)}


def _rounded(b: Any, rng: np.random.Generator) -> tuple[Any, dict[str, Any]]:
    body, z, _ = _plate(b, rng, float(rng.integers(5, 9)))
    return body, {"top": _is_level(z), "bottom": _is_level(0.0)}


def _angle(b: Any, rng: np.random.Generator) -> tuple[Any, dict[str, Any]]:
    x, y, t, h = (float(v) for v in (rng.integers(35, 55), rng.integers(30, 45), rng.integers(7, 11), rng.integers(15, 30)))
    body = b.extrude(b.make_face(b.Polyline((0, 0), (x, 0), (x, t), (t, t), (t, y), (0, y), close=True)), h)
    return body, {"top": _is_level(h), "bottom": _is_level(0.0)}


def _boss(b: Any, rng: np.random.Generator) -> tuple[Any, dict[str, Any]]:
    body, z, _ = _plate(b, rng)
    r, h = float(rng.integers(6, 10)), float(rng.integers(8, 14))
    boss = b.Pos(0, 0, z) * b.Cylinder(r, h, align=(b.Align.CENTER, b.Align.CENTER, b.Align.MIN))
    rim = _is_level(z)
    return body + boss, {
        "rim": lambda e: rim(e) and e.geom_type == b.GeomType.LINE,
        "foot": lambda e: rim(e) and e.geom_type != b.GeomType.LINE,
    }


def _pocket(b: Any, rng: np.random.Generator) -> tuple[Any, dict[str, Any]]:
    body, z, (x, y) = _plate(b, rng)
    w, d = float(round(0.5 * x)), float(round(0.5 * y))
    body -= b.Pos(0, 0, z - z // 2) * b.extrude(b.RectangleRounded(w, d, 4.0), z)

    def outside(edge: Any) -> bool:
        at = edge.center()
        return abs(at.X) > x / 2 - 1e-6 or abs(at.Y) > y / 2 - 1e-6

    rim = _is_level(z)
    return body, {"mouth": lambda e: rim(e) and not outside(e), "rim": lambda e: rim(e) and outside(e)}


def _rib(b: Any, rng: np.random.Generator) -> tuple[Any, dict[str, Any]]:
    body, z, (x, y) = _plate(b, rng)
    w, d, h = float(round(0.4 * x)), 8.0, float(rng.integers(8, 14))
    rib = b.Pos(0, 0, z) * b.Box(w, d, h, align=(b.Align.CENTER, b.Align.CENTER, b.Align.MIN))

    def foot(edge: Any) -> bool:
        at = edge.center()
        return _is_level(z)(edge) and abs(at.X) < x / 2 - 1e-6 and abs(at.Y) < y / 2 - 1e-6

    return body + rib, {"foot": foot, "top": _is_level(z + h)}


def _block(b: Any, rng: np.random.Generator) -> tuple[Any, dict[str, Any]]:
    body, _, _ = _plate(b, rng)
    return body, {"all": lambda _: True}


BODIES = (_plain, _rounded, _angle, _boss, _pocket, _rib, _block)


# --- fits and scores ------------------------------------------------------------------------------------------------------


def fit(shape: Any, asked: AskedPart) -> None:
    """Write the part as STL, or as its scan, beside the folder, and reconstruct it there."""
    import build123d as b

    from imdim.app import fit as command
    from imdim.reconstruction.config import Settings

    asked.folder.parent.mkdir(parents=True, exist_ok=True)
    part = asked.folder.with_suffix(".stl")
    b.export_stl(shape, str(part), *FINE)
    part = sample(part, asked.condition, asked.folder.with_suffix(".npy"))
    command.fit(Settings(input=str(part), output=str(asked.folder), budget_s=asked.budget))


def score(asked: AskedPart, planted: Sequence[PlantedEdge]) -> dict[str, float]:
    """How many planted edges were found, with what sizes, and how much was blended beside them."""
    from imdim.geometry.edges import find_edges
    from imdim.program import codec
    from imdim.target.scan import parse_condition

    scanned = parse_condition(asked.condition)
    report = json.loads((asked.folder / "report.json").read_text(encoding="utf-8"))
    near = max(NEAR, SHAKEN * scanned.noise * report["target"]["diagonal"] if scanned else 0.0)
    document = codec.parse((asked.folder / "program.json").read_bytes())
    features = codec.edges_of(document)
    edges = find_edges(codec.from_json(document), features).edges if features else ()
    known = report.get("intervals", {})
    found = right = 0
    stated: dict[str, float] = {}
    for edge in planted:
        middle = edge.points[PLACES // 2][None]
        own = [e for e in edges if e.kind == edge.kind and e.distances(middle)[0] < near]
        found += bool(own)
        right += any(max(abs(s / edge.size - 1) for s in e.sizes) < RIGHT for e in own)
        stated.update({name: edge.size for e in own for name in features[e.feature].size_names if name in known})
    every = np.concatenate([edge.points for edge in planted])
    lengths, strange = [], []
    for e in edges:
        points = e.points(PLACES)
        lengths.append(float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()))
        gap = np.linalg.norm(points[PLACES // 2] - every, axis=1).min()
        # planted points lie a length / PLACES apart
        strange.append(lengths[-1] if gap > max(near, 1.5 * lengths[-1] / PLACES) else 0.0)
    held = sum(abs(known[name]["measured"] - size) <= known[name]["half"] for name, size in stated.items())
    iou = report["scores"]["volume_iou"]
    return {
        "edges": len(planted),
        "found": found,
        "right": right,
        "length": sum(lengths),
        "strange": sum(strange),
        "stated": len(stated),
        "held": held,
        "features": report["result"]["primitives"],
        "iou": np.nan if iou is None else iou,
        "seconds": report["timing"]["total_s"],
    }


if __name__ == "__main__":
    sys.exit(main())
