"""Fit what people draw in OpenSCAD with few sides to a circle, and ask for their program: not the facets' one.

    python scripts/bench/coarse.py FOLDER [--sides 16,24,30] [--openscad openscad] [--budget 60] [--clock wall] [--only dome,knob]

Each design of DESIGNS is meshed by OpenSCAD at each number of sides, fitted with the default settings, and compared with itself at 96
sides, which no fit has seen: IoU with that, and the features that it takes beside those in the design, copies counted. A part counts as
the design's where the IoU is at least SAME and it takes no more features. A part that no program was written of, or that is told not to
be the part, counts with an IoU of 0. Parts that are in the folder already are scored alone. Exit status 2: OpenSCAD is not there, or
cannot draw one.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path
from textwrap import dedent
from typing import NamedTuple

import trimesh
from processor import CLOCKS, children_s

from imdim.geometry.solid import mesh_to_manifold, volume_iou

BAD_INPUT = 2
SMOOTH = 96
SAME = 0.99
FAILED = "failed"  # in place of features


class Design(NamedTuple):
    """What a person wrote, and how many features they put into it, copies counted."""

    text: str
    features: int


DESIGNS = {
    "ball": Design(
        """
        difference() { intersection() { cube(20, center = true); sphere(13.3); } for (r = [[0, 0, 0], [90, 0, 0], [0,
        90, 0]]) rotate(r) cylinder(r = 6.5, h = 50, center = true); }
        """,
        5,
    ),
    "socket": Design(
        """
        difference() { cube([30, 30, 20], center = true); translate([0, 0, 8]) sphere(11); translate([0, 0, -12])
        cylinder(r = 4, h = 30); }
        """,
        3,
    ),
    "dome": Design(
        """
        difference() { union() { intersection() { sphere(15); translate([-20, -20, 0]) cube(40); } translate([0, 0,
        -5]) cylinder(r = 15, h = 5.01); } translate([0, 0, -6]) cylinder(r = 4, h = 30); translate([8, 0, -20])
        cube([20, 5, 40]); }
        """,
        5,
    ),
    "knob": Design(
        """
        difference() { union() { cylinder(r = 10, h = 8); translate([0, 0, 8]) scale([1, 1, 0.5]) sphere(10); }
        translate([0, 0, -1]) cylinder(r = 3, h = 8); for (a = [0 : 60 : 300]) rotate(a) translate([12, 0, -1])
        cylinder(r = 3.5, h = 30); }
        """,
        9,
    ),
    "open_ring": Design(
        """
        difference() { rotate_extrude() translate([15, 0]) circle(4); translate([0, -30, -10]) cube([30, 30, 20]);
        translate([-15, 0, 0]) cylinder(r = 1.5, h = 20, center = true); }
        """,
        3,
    ),
    "cone": Design(
        """
        difference() { cylinder(r1 = 14, r2 = 6, h = 20); translate([0, 0, -1]) cylinder(r = 4, h = 30); translate([5,
        -30, 8]) cube([30, 60, 6]); translate([-20, 0, 6]) rotate([0, 90, 0]) cylinder(r = 3, h = 15); }
        """,
        4,
    ),
    "capsule": Design(
        """
        difference() { hull() { translate([-10, 0, 0]) sphere(6); translate([10, 0, 0]) sphere(6); } translate([-20,
        -20, -10]) cube([40, 40, 8]); cylinder(r = 2.5, h = 30, center = true); }
        """,
        5,
    ),
    "bracket": Design(
        """
        difference() { union() { cube([60, 20, 4]); cube([4, 20, 40]); } for (x = [20, 45]) translate([x, 10, -1])
        cylinder(r = 2.2, h = 10); for (x = [20, 45]) translate([x, 10, 1.8]) cylinder(r1 = 2.2, r2 = 4.5, h = 2.3);
        translate([-1, 10, 28]) rotate([0, 90, 0]) cylinder(r = 3.3, h = 10); }
        """,
        7,
    ),
    "elbow": Design(
        """
        difference() { union() { rotate_extrude(angle = 90) translate([25, 0]) circle(8); translate([25, 0, 0])
        rotate([90, 0, 0]) cylinder(r = 11, h = 4); translate([0, 25, 0]) rotate([0, -90, 0]) cylinder(r = 11, h = 4);
        } rotate_extrude(angle = 90) translate([25, 0]) circle(6); translate([25, 1, 0]) rotate([90, 0, 0]) cylinder(r
        = 6, h = 10); translate([1, 25, 0]) rotate([0, -90, 0]) cylinder(r = 6, h = 10); }
        """,
        6,
    ),
    "adapter": Design(
        """
        difference() { union() { cylinder(r = 15, h = 20); translate([0, 0, 20]) cylinder(r1 = 15, r2 = 9, h = 15);
        translate([0, 0, 35]) cylinder(r = 9, h = 20); translate([0, 0, 50]) cylinder(r = 10, h = 2); } translate([0,
        0, -1]) cylinder(r = 13, h = 21.01); translate([0, 0, 20]) cylinder(r1 = 13, r2 = 7, h = 15.01); translate([0,
        0, 35]) cylinder(r = 7, h = 30); }
        """,
        7,
    ),
    "standoffs": Design(
        """
        difference() { union() { hull() for (x = [-20, 20], y = [-15, 15]) translate([x, y, 0]) cylinder(r = 5, h =
        3); for (x = [-20, 20], y = [-15, 15]) translate([x, y, 0]) cylinder(r = 3.5, h = 12); } for (x = [-20, 20], y
        = [-15, 15]) translate([x, y, -1]) cylinder(r = 1.5, h = 20); translate([0, 0, -1]) cylinder(r = 8, h = 10); }
        """,
        13,
    ),
    "handle": Design(
        """
        difference() { union() { rotate([0, 90, 0]) cylinder(r = 8, h = 80, center = true); for (s = [-1, 1])
        translate([s * 40, 0, 0]) sphere(8); translate([0, 0, 8]) cube([20, 12, 8], center = true); } translate([0, 0,
        -20]) cylinder(r = 3, h = 50); translate([0, 0, -9]) cylinder(r = 5.5, h = 5); }
        """,
        6,
    ),
}


def main(arguments: list[str] | None = None) -> int:
    about = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    about.add_argument("folder", type=Path)
    about.add_argument("--sides", default="16,24,30")
    about.add_argument("--openscad", default="openscad")
    about.add_argument("--budget", type=float, default=60.0)
    about.add_argument("--clock", choices=CLOCKS, default="wall")
    about.add_argument("--only", default=",".join(DESIGNS))
    given = about.parse_args(arguments)
    rows, names = [], given.only.split(",")
    if unknown := [name for name in names if name not in DESIGNS]:
        sys.stderr.write(f"coarse.py: no design is called {unknown[0]}; known are {', '.join(DESIGNS)}\n")
        return BAD_INPUT
    print("| part | IoU | with the design | features | the design's | seconds |\n| --- | --- | --- | --- | --- | --- |")
    for name in names:
        try:
            smooth = mesh_to_manifold(trimesh.load(draw(name, SMOOTH, given.folder, given.openscad)))
            for sides in map(int, given.sides.split(",")):
                draw(name, sides, given.folder, given.openscad)
        except (OSError, subprocess.CalledProcessError) as error:
            sys.stderr.write(f"coarse.py: {name}: OpenSCAD draws no mesh of it: {error}\n")
            return BAD_INPUT
        for sides in map(int, given.sides.split(",")):
            fit(given.folder, f"{name}_{sides}", given.budget, given.clock)
            rows.append(score(given.folder, name, sides, smooth))
            print("| {part} | {iou:.4f} | {same:.4f} | {features} | {wanted} | {seconds:.1f} |".format(**rows[-1]), flush=True)
    own = sum(row["same"] >= SAME and row["features"] <= row["wanted"] for row in rows if row["features"] != FAILED)
    failed = sum(row["features"] == FAILED for row in rows)
    print(f"\n{len(rows)} parts, {failed} failed: {own} are the design's, {sum(row['seconds'] for row in rows) / len(rows):.1f} s each")
    return 0


def draw(name: str, sides: int, folder: Path, openscad: str) -> Path:
    """The mesh of a design with so many sides to a circle."""
    folder.mkdir(parents=True, exist_ok=True)
    text, mesh = folder / f"{name}_{sides}.scad", folder / f"{name}_{sides}.stl"
    if not mesh.exists():
        text.write_text(f"$fn = {sides};\n{dedent(DESIGNS[name].text)}")
        subprocess.run([openscad, "-o", str(mesh), str(text)], check=True, capture_output=True)
    return mesh


def fit(folder: Path, part: str, budget: float, clock: str) -> None:
    """A part's results and how long they took, where they are not there yet."""
    if (folder / part / "fitted.json").exists():
        return
    command = ["-m", "imdim"] if clock == "wall" else [str(Path(__file__).parent / "processor.py")]
    begun, spent = time.perf_counter(), children_s()
    how = ["fit", str(folder / f"{part}.stl"), "-o", str(folder / part), "--force", "--quiet", "--budget", str(budget)]
    status = subprocess.run([sys.executable, *command, *how], check=False).returncode
    seconds = time.perf_counter() - begun if clock == "wall" else children_s() - spent
    (folder / part).mkdir(exist_ok=True)
    (folder / part / "fitted.json").write_text(json.dumps({"status": status, "seconds": seconds}))


def score(folder: Path, name: str, sides: int, smooth: object) -> dict[str, object]:
    """A part's IoU with its mesh and with the design, its features and the design's, and its seconds."""
    part, wanted = f"{name}_{sides}", DESIGNS[name].features
    told = json.loads((folder / part / "fitted.json").read_text())
    if told["status"]:
        return {"part": part, "iou": 0.0, "same": 0.0, "features": FAILED, "wanted": wanted, "seconds": told["seconds"]}
    report = json.loads((folder / part / "report.json").read_text())
    found = mesh_to_manifold(trimesh.load(folder / part / "mesh.stl"))
    return {
        "part": part,
        "iou": report["scores"]["volume_iou"],
        "same": volume_iou(found, smooth),  # type: ignore[arg-type]
        "features": report["result"]["primitives"],
        "wanted": wanted,
        "seconds": told["seconds"],
    }


if __name__ == "__main__":
    sys.exit(main())
