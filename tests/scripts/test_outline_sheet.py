"""The contact sheet of outlines: every part has a tile, and a sketch is the outline at scale."""

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tests.drawn import BORED, PULLEY, SLOTTED, centred

from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program import codec
from imdim.program.outline import Outline, circle
from imdim.program.tree import Combine, Primitive

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))

from outline_sheet import FILL, FOOTER, MARGIN, SIDE, draw_sketch, find_richest, main

BALL = Primitive("sphere", (3.0,))
RINGS = Outline((circle(10.0), circle(8.0), circle(5.0), circle(2.0)))  # a ring with an island that has a hole


@pytest.fixture
def results(tmp_path):
    """A benchmark's folders: a part with outlines, one without, one that failed, and one that was not benchmarked."""
    for name, program in (("bored", BORED), ("ball", BALL), ("failed", BALL), ("other", BALL)):
        (tmp_path / "parts").mkdir(exist_ok=True)
        to_trimesh(to_manifold(program, 24)).export(tmp_path / "parts" / f"{name}.stl")
        if name != "other":
            (tmp_path / "out" / name).mkdir(parents=True)
        if name in ("bored", "ball"):
            (tmp_path / "out" / name / "program.json").write_text(codec.dumps(program))
    return tmp_path


def blank(tile: np.ndarray) -> bool:
    return bool((tile == 255).all())


def test_every_part_has_its_tile(results, capsys):
    sheet = results / "sheet.png"
    assert main([str(results / "out"), "--parts", str(results / "parts"), "--out", str(sheet)]) == 0
    assert capsys.readouterr().out == f"{sheet}: 3 parts\n"
    pixels = np.asarray(Image.open(sheet))
    assert pixels.shape == (2 * (SIDE + 16), 2 * 3 * SIDE, 3)
    ball, bored, failed = (pixels[16 + y : 16 + y + SIDE, x : x + 3 * SIDE] for y, x in ((0, 0), (0, 3 * SIDE), (SIDE + 16, 0)))
    filled = [(tile[:, 2 * SIDE :] == FILL).all(2).mean() for tile in (ball, bored, failed)]
    assert filled[1] > 0.05
    assert (filled[0], filled[2]) == (0, 0)
    assert not blank(failed[:, :SIDE])
    assert blank(failed[:, 2 * SIDE :])
    assert blank(pixels[SIDE + 16 :, 3 * SIDE :])


@pytest.mark.parametrize("outline", [SLOTTED, RINGS])
def test_a_sketch_covers_the_area_of_the_outline(outline):
    """At its scale, holes left out and islands filled; what the pen takes of it is allowed for."""
    picture = np.asarray(draw_sketch(centred(outline, 5.0), SIDE))[: SIDE - FOOTER]
    (left, low), (right, high) = outline.bounds
    scale = (SIDE - 2 * MARGIN - FOOTER) / max(right - left, high - low)
    inked = (picture.min(2) < 250).mean() * SIDE * (SIDE - FOOTER)
    assert inked / scale**2 == pytest.approx(outline.area, rel=0.08)


def test_the_outline_with_most_curves_is_shown():
    plate = centred(SLOTTED, 5.0)
    assert find_richest(Combine("difference", PULLEY, Combine("union", BALL, plate))) == plate
    assert find_richest(BALL) is None


@pytest.mark.parametrize(("parts", "said"), [("nowhere", "No such file"), ("out", "0 model files")])
def test_folders_that_hold_no_parts_are_one_line(results, capsys, parts, said):
    assert main([str(results / "out"), "--parts", str(results / parts), "--out", str(results / "sheet.png")]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (results / "sheet.png").exists()
