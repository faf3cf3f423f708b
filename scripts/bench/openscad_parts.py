"""Draw parts that nobody here worked on: of MCAD, the library that comes with OpenSCAD, and its examples.

    python scripts/bench/openscad_parts.py FOLDER [--openscad openscad] [--share /usr/share/openscad]
    python scripts/bench/benchmark.py FOLDER --clock processor

Nuts, bolts, gears, boxes, motors, servos, mounts and what the examples show, a helix and twisted columns among them, as the installed
OpenSCAD makes them: as coarse as its users leave them. Exit status 2: OpenSCAD, or one of its files, is not there.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

BAD_INPUT = 2
PATIENCE_S = 300.0
# by name: the file of MCAD, whether all of it is run, and what is drawn
MCAD = {
    "lego": ("use", "lego_compatibility", "$fn = 40; block(2, 4, 1, reinforcement = true);"),
    "bearing": ("include", "bearing", "$fn = 60; bearing(model = 608);"),
    "cap_bolt": ("include", "metric_fastners", "$fn = 48; cap_bolt(5, 20);"),
    "sunk_bolt": ("include", "metric_fastners", "$fn = 48; csk_bolt(5, 20);"),
    "hex_bolt": ("include", "metric_fastners", "$fn = 48; bolt(6, 25);"),
    "flat_nut": ("include", "metric_fastners", "$fn = 48; flat_nut(6);"),
    "gear": (
        "use",
        "involute_gears",
        "$fn = 48; gear(number_of_teeth = 17, circular_pitch = 500, hub_diameter = 20, rim_width = 4, circles = 4);",
    ),
    "pinion": ("use", "gears", "linear_extrude(6) gear(number_of_teeth = 20, circular_pitch = 300, pressure_angle = 20);"),
    "align_servo": ("include", "servos", "$fn = 40; alignds420([0, 0, 0], [0, 0, 0], screws = 0);"),
    "futaba_servo": ("include", "servos", "$fn = 40; futabas3003([0, 0, 0], [0, 0, 0]);"),
    "stepper": ("include", "stepper", "$fn = 48; motor(Nema17, NemaMedium, false);"),
    "motor_mount": (
        "use",
        "motors",
        "$fn = 48; difference() { translate([-35, -35, 0]) cube([70, 70, 6]); translate([0, 0, -1]) linear_extrude(8) "
        "stepper_motor_mount(17, slide_distance = 6, mochup = false, tolerance = 0.2); }",
    ),
    "round_tray": (
        "include",
        "boxes",
        "$fn = 40; difference() { roundedBox([60, 40, 25], 5, true); translate([0, 0, 3]) roundedBox([54, 34, 25], 3, true); }",
    ),
    "round_block": ("include", "boxes", "$fn = 32; roundedBox([60, 40, 25], 6, false);"),
    "beam": ("include", "gridbeam", "$fn = 32; zBeam(4);"),
    "round_plate": (
        "include",
        "2Dshapes",
        "$fn = 48; linear_extrude(5) complexRoundSquare([75, 30], [20, 10], [10, 10], [5, 5], [8, 8], center = true);",
    ),
    "hexagon_tube": ("include", "regular_shapes", "hexagon_tube(20, 15, 3); translate([0, 0, -4]) octagon_prism(4, 20);"),
    "teardrop": (
        "include",
        "teardrop",
        "$fn = 48; difference() { cube([30, 20, 20], center = true); teardrop(5, 40, 90); "
        "translate([0, 0, 6]) cube([18, 30, 9], center = true); }",
    ),
}
EXAMPLES = (
    *(f"Basics/{name}" for name in ("CSG-modules", "linear_extrude", "rotate_extrude")),
    *(f"Old/example{number:03d}" for number in (1, 2, 3, 4, 5, 6, 7, 9, 11, 20, 21, 24)),
    *(f"Parametric/{name}" for name in ("candleStand", "sign")),
)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--openscad", default="openscad")
    parser.add_argument("--share", type=Path, default=Path("/usr/share/openscad"), help="where its examples and libraries are")
    given = parser.parse_args(arguments)
    given.folder.mkdir(parents=True, exist_ok=True)
    try:
        for name, (how, library, text) in MCAD.items():
            source = given.folder / f"{name}.scad"
            source.write_text(f"{how} <MCAD/{library}.scad>\n{text}\n", encoding="utf-8")
            _draw(given.openscad, source, given.folder / f"{name}.stl")
            source.unlink()
        for example in EXAMPLES:
            source = given.share / "examples" / f"{example}.scad"
            if not source.is_file():
                raise FileNotFoundError(f"{source}: no such file")
            _draw(given.openscad, source, given.folder / f"{source.stem}.stl")
    except (OSError, subprocess.SubprocessError) as error:
        sys.stderr.write(f"openscad_parts: {error}\n")
        return BAD_INPUT
    print(f"{len(MCAD) + len(EXAMPLES)} parts: {given.folder}")
    return 0


def _draw(openscad: str, source: Path, mesh: Path) -> None:
    subprocess.run([openscad, "-o", str(mesh), str(source)], check=True, capture_output=True, timeout=PATIENCE_S)


if __name__ == "__main__":
    sys.exit(main())
