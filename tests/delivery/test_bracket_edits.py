"""Edits that a person would make of the bundled bracket do what the same edits of its source do, and nothing else."""

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold, OpType

from imdim.delivery.finish import finish
from imdim.export.delivered import texts_of
from imdim.export.edit import change_values, open_delivered, solid_of
from imdim.geometry.solid import mesh_to_manifold, volume_iou
from imdim.program.codec import dumps, parse
from imdim.reconstruction.config import Settings
from imdim.reconstruction.fitting import find_relations
from imdim.reconstruction.pipeline import reconstruct
from imdim.target.target import load_target

SOURCE = Path(__file__).parents[2] / "dataset" / "examples" / "bracket.scad"
SAME = 0.999
FACETS = 96

THICKER = {  # by 2: what stands on the plate, or enters it from above, goes up with its face
    "translate([0, 0, 4]) cube([80, 50, 8]": "translate([0, 0, 5]) cube([80, 50, 10]",
    "[-40, 0, 4]) cylinder(r = 25, h = 8": "[-40, 0, 5]) cylinder(r = 25, h = 10",
    "[40, 0, 4]) cylinder(r = 25, h = 8": "[40, 0, 5]) cylinder(r = 25, h = 10",
    "[0, 0, 22])": "[0, 0, 24])",
    "[0, 0, 14])": "[0, 0, 16])",
    "[0, 19, 15])": "[0, 19, 17])",
    "[0, -19, 15])": "[0, -19, 17])",
    "[18, 0, 26])": "[18, 0, 28])",
    "[0, 0, 18]) cylinder(r = 10, h = 44": "[0, 0, 20]) cylinder(r = 10, h = 48",
    "[0, 0, 33])": "[0, 0, 35])",
    "[-48, 0, 4]) cylinder(r = 5, h = 12": "[-48, 0, 6]) cylinder(r = 5, h = 16",
    "[48, 0, 4]) cylinder(r = 5, h = 12": "[48, 0, 6]) cylinder(r = 5, h = 16",
    "[-48, 0, 6.5])": "[-48, 0, 8.5])",
    "[48, 0, 6.5])": "[48, 0, 8.5])",
}
EDITS = {
    "plate thicker": ({"plate_thickness": 10.0}, THICKER),
    "holes further out": ({"m8_hole_spacing": 102.0}, {"[-48,": "[-51,", "[48,": "[51,"}),
    "larger bore": (  # its chamfer begins at it
        {"bore": 22.0},
        {"r = 10, h = 44": "r = 11, h = 44", "r1 = 10, r2 = 14, h = 8": "r1 = 11, r2 = 14, h = 8"},
    ),
    "larger nipple": ({"ball_radius": 8.0}, {"sphere(r = 5)": "sphere(r = 8)"}),
    "higher boss": (
        {"turned_part_height": 32.0},
        {"22]) cylinder(r = 18, h = 28": "24]) cylinder(r = 18, h = 32", "18]) cylinder(r = 10, h = 44": "20]) cylinder(r = 10, h = 48"}
        | {"translate([0, 0, 33])": "translate([0, 0, 37])"},
    ),
    "thinner ribs": ({"rib": 4.0}, {"cube([6, 12, 14]": "cube([4, 12, 14]"}),
}


@pytest.fixture(scope="module")
def bracket():
    target = load_target(SOURCE.with_suffix(".stl"))
    *_, last = reconstruct(target, Settings(), np.random.default_rng(0))
    found = finish(*find_relations(last.program, target))
    texts = texts_of(found.program, found.parameters, found.folded, 96)
    return open_delivered(parse(dumps(found.program, None, found.constraints, found.folded)), texts)


def solids(text: str) -> list[Manifold]:
    """Of the lines that draw one."""
    found = []
    for place, kind, given in re.findall(r"translate\(\[(.+?)\]\) (\w+)\((.+?)\);", text):
        size = {name: float(value) for name, value in re.findall(r"(\w+) = ([\d.]+)", given)}
        if kind == "cube":
            solid = Manifold.cube([float(edge) for edge in re.findall(r"[\d.]+", given)], center=True)
        elif kind == "sphere":
            solid = Manifold.sphere(size["r"], FACETS)
        else:
            bottom, top = (size.get(end, size.get("r")) for end in ("r1", "r2"))
            solid = Manifold.cylinder(size["h"], bottom, top, FACETS, center=True)
        found.append(solid.translate([float(coordinate) for coordinate in place.split(",")]))
    return found


def drawn(changes: dict[str, str]) -> Manifold:
    """What the source draws with these changes, by the modeller alone: OpenSCAD takes six seconds for each."""
    text = SOURCE.read_text()
    for before, after in changes.items():
        assert before in text
        text = text.replace(before, after)
    whole, cuts = (Manifold.batch_boolean(solids(part), OpType.Add) for part in text.split("    }\n"))
    return whole - cuts


def test_the_source_is_drawn_as_openscad_draws_it():
    bundled = mesh_to_manifold(trimesh.load_mesh(SOURCE.with_suffix(".stl")))
    assert volume_iou(drawn({}), bundled) > 0.9999


@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_does_what_the_same_edit_of_the_source_does(bracket, edit):
    values, changes = EDITS[edit]
    # a bore and a rib are parts of drawings: their names say where, their values which
    values = {next((n for n, v in bracket.values.items() if v == {"bore": 20.0, "rib": 6.0}.get(k)), k): v for k, v in values.items()}
    edited = solid_of(change_values(bracket, values))
    wanted = drawn(changes)
    assert volume_iou(edited, wanted) >= SAME
    assert volume_iou(solid_of(bracket), wanted) < SAME, "the edit is one that can be seen"
