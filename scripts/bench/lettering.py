"""Plant parts with text on a face, fit them, and ask whether the part without its text comes back.

    python scripts/bench/lettering.py [--parts 20] [--seed 0] [--out out/lettering] [--budget 60] [--clock wall] [--only 3,17]

Parts are about 80 long: plates with holes, discs, angles with a rib, trays. Their text is that of OpenSCAD's `text()`, which has to be
installed: one or two rows in one of FONTS, raised or sunk, on a face or on the floor of a tray, along the part or aslant; one part in four
is turned by odd angles. They are fitted with the default settings into the folder, one folder a part; parts that are there already are
scored alone.

A text is set aside if the program's solid is the part without it, up to 0.1 % of the volume, and told if the verdict has a region of the
kind text. Each part that ends with another exit status than 0 counts as failed.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
from manifold3d import Manifold
from planted_parts import asked_parts

FONTS = (
    "Liberation Sans",
    "Liberation Sans:style=Bold",
    "Liberation Serif",
    "DejaVu Sans Mono",
    "Liberation Sans Narrow",
    "DejaVu Serif:style=Bold",
    "Liberation Sans:style=Italic",
    "DejaVu Sans",
)
WORDS = ("IMDIM 42", "Rev B", "M8 x 1.25", "left", "PUSH", "Open", "Thor v2.1", "TOP", "www.imdim.org", "2026-11", "Typ 7a", "Made here")
SAME = 1e-3  # of the volume, by which the program's solid may differ from the part without text
SEGMENTS = 128  # of a circle: the program's has 96


class Planted(NamedTuple):
    """A part with its text, and without."""

    solid: Manifold
    plain: Manifold


def main() -> None:
    rows = []
    for rng, number, folder, budget, _ in asked_parts(__doc__, Path("out/lettering"), parts=20):
        planted = plant(rng, number)
        if not (folder / "fitted.json").exists():
            fit(planted.solid, folder, budget)
        rows.append(score(folder, planted))
        print(f"{folder.name}: " + ", ".join(f"{k} {v:.6g}" for k, v in rows[-1].items()), flush=True)
    print(totals(rows))


def totals(rows: Sequence[dict[str, float]]) -> str:
    """The counts of all parts, in a line."""
    n = {key: sum(row[key] for row in rows) for key in rows[0]}
    middle = {key: float(np.median([row[key] for row in rows])) for key in ("features", "curves", "seconds")}
    many = ", ".join(f"{key} {n[key]:.6g} (median {middle[key]:.3g})" for key in middle)
    return f"{len(rows)} parts: {n['aside']:.0f} without their text, {n['told']:.0f} told by the verdict, {n['failed']:.0f} failed; {many}"


# --- parts --------------------------------------------------------------------------------------------------------------


def plant(rng: np.random.Generator, number: int) -> Planted:
    """A part; bodies, fonts and ways take turns."""
    body, room, level = BODIES[number % len(BODIES)](rng)
    raised = bool((number + number // len(BODIES)) % 2)
    words = [str(rng.choice(WORDS)) for _ in range(1 + number // 2 % 2)]
    wide, high = room
    size = min(high / (1.7 * len(words)), wide / (0.95 * max(map(len, words))))
    depth = float(min(rng.choice([0.4, 0.6, 0.8, 1.0]), 0.2 * size))
    text = draw_text(words, FONTS[number % len(FONTS)], size, 2 * depth)
    text = text.rotate((0, 0, float(rng.choice([0, 0, 0, 12, 180])))).translate((0, 0, level - depth))
    solid = body + text if raised else body - text
    turn = tuple(rng.uniform(10, 80, 3).tolist()) if number % 4 == 3 else (90.0 * (number % 3), 0.0, 90.0 * (number % 2))
    shift = tuple(rng.integers(-30, 30, 3).tolist())
    return Planted(solid.rotate(turn).translate(shift), body.rotate(turn).translate(shift))


def draw_text(words: Sequence[str], font: str, size: float, height: float) -> Manifold:
    """Rows of text about the origin, extruded from z = 0, as OpenSCAD draws them."""
    style = f'size={size}, font="{font}", halign="center", valign="center"'
    lines = [1.5 * size * ((len(words) - 1) / 2 - i) for i in range(len(words))]
    rows = "".join(f'translate([0, {y}]) text("{word}", {style});' for word, y in zip(words, lines, strict=True))
    with tempfile.TemporaryDirectory() as folder:
        source, mesh = Path(folder) / "text.scad", Path(folder) / "text.off"
        source.write_text(f"$fn = 24; linear_extrude({height}) {{ {rows} }}")
        subprocess.run(["openscad", "-o", str(mesh), str(source)], check=True, capture_output=True)
        return _manifold(trimesh.load_mesh(mesh))


def _manifold(mesh: trimesh.Trimesh) -> Manifold:
    from imdim.geometry.solid import mesh_to_manifold

    return mesh_to_manifold(mesh)


def _plate(rng: np.random.Generator) -> tuple[Manifold, tuple[float, float], float]:
    x, y, z = (float(v) for v in (rng.integers(70, 90), rng.integers(25, 40), rng.integers(4, 9)))
    body = _box(x, y, 0, z)
    for side in (-1, 1):
        body -= _rod(2.25, -1, z + 1).translate((side * (x / 2 - 6), 0, 0))
    return body, (x - 28, y - 8), z


def _disc(rng: np.random.Generator) -> tuple[Manifold, tuple[float, float], float]:
    r, z = float(rng.integers(25, 40)), float(rng.integers(5, 9))
    body = _rod(r, 0, z)
    for angle in (45, 135, 225, 315):
        body -= _rod(2.0, -1, z + 1).translate((r - 6, 0, 0)).rotate((0, 0, angle))
    return body, (1.2 * r, 0.6 * r), z


def _angle(rng: np.random.Generator) -> tuple[Manifold, tuple[float, float], float]:
    x, y, z, high = (float(v) for v in (rng.integers(50, 70), rng.integers(40, 50), rng.integers(5, 8), rng.integers(25, 35)))
    wall = _box(z, y, 0, high).translate((z / 2 - x / 2, 0, 0))
    hole = _rod(3.0, -x, x).rotate((0, 90, 0)).translate((0, 0, high - 8))
    rib = _box(14, 4, 0, z + 12).translate((z + 7 - x / 2, y / 2 - 2, 0))
    return _box(x, y, 0, z) + wall + rib - hole, (x - 2 * z - 12, y - 16), z


def _tray(rng: np.random.Generator) -> tuple[Manifold, tuple[float, float], float]:
    x, y, z = (float(v) for v in (rng.integers(70, 90), rng.integers(30, 45), rng.integers(8, 12)))
    return _box(x, y, 0, z) - _box(x - 8, y - 8, 3, z + 1), (x - 16, y - 16), 3.0


BODIES = (_plate, _disc, _angle, _tray)


def _box(x: float, y: float, low: float, high: float) -> Manifold:
    return Manifold.cube((x, y, high - low)).translate((-x / 2, -y / 2, low))


def _rod(radius: float, low: float, high: float) -> Manifold:
    return Manifold.cylinder(high - low, radius, radius, SEGMENTS).translate((0, 0, low))


# --- fits and scores ----------------------------------------------------------------------------------------------------


def fit(solid: Manifold, folder: Path, budget_s: float) -> None:
    """As `imdim fit` does it; its exit status and seconds are kept beside the results."""
    from imdim.app.cli import main as imdim
    from imdim.geometry.solid import to_trimesh

    folder.parent.mkdir(parents=True, exist_ok=True)
    source = folder.with_suffix(".stl")
    to_trimesh(solid).export(source)
    before = time.perf_counter()
    status = imdim(["fit", str(source), "-o", str(folder), "--budget", str(budget_s), "--force"])
    (folder / "fitted.json").write_text(json.dumps({"status": status, "seconds": time.perf_counter() - before}))


def score(folder: Path, planted: Planted) -> dict[str, float]:
    """Whether the text is gone and told, and how large the program is."""
    from imdim.geometry.solid import symmetric_difference_volume
    from imdim.program.codec import from_json, parse
    from imdim.program.cost import count

    report, fitted = (json.loads((folder / name).read_text()) for name in ("report.json", "fitted.json"))
    counts = count(from_json(parse((folder / "program.json").read_bytes())))
    whole = planted.plain.volume()
    off = symmetric_difference_volume(_manifold(trimesh.load_mesh(folder / "mesh.stl")), planted.plain)
    return {
        "aside": off < SAME * whole,
        "told": any(region["kind"] == "text" for region in report["verdict"]["regions"]),
        "failed": fitted["status"] != 0,
        "features": counts.primitives,
        "curves": counts.curves,
        "iou": report["scores"]["volume_iou"],
        "text": abs(planted.solid.volume() - whole) / whole,
        "seconds": fitted["seconds"],
    }


if __name__ == "__main__":
    main()
