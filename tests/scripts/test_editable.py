"""What the bench of editability counts, on programs whose numbers are known; and the README's picture of an edit."""

import json
import sys
from pathlib import Path

import pytest
from PIL import Image
from tests.planted import box, cut, cylinder

from imdim.export.edit import open_delivered, write
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.codec import dumps, parse
from imdim.program.outline import Outline, circle
from imdim.program.tree import Primitive, combine_all

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))
sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))

import editable

import make_edit_picture

PLATE = cut(box(80.0, 50.0, 6.0), cylinder(3.1234, 8.0))


def written(program, folder):
    write(open_delivered(parse(dumps(program)), {}), folder)
    return folder


def test_numbers_off_the_grid_are_counted(tmp_path):
    found = editable.read(written(PLATE, tmp_path / "plate") / "program.json")
    assert found.numbers - found.on_grid == 1, "the hole's diameter alone"
    assert (found.odd_coefficients, found.depth, found.outlines) == (0, 1, 0)
    inch = editable.read(written(box(25.4, 25.4 / 4, 3.0), tmp_path / "inch") / "program.json")
    assert inch.on_grid == inch.numbers == 3


def leaf(sizes, x, turned=False):
    rows = [[0.6, -0.8, 0.0, x], [0.8, 0.6, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]] if turned else [[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0]]
    return ["leaf", "box", {"size": sizes, "center": True}, [*rows[0], *rows[1], *rows[2], 0.0, 0.0, 0.0, 1.0]]


@pytest.mark.parametrize(
    ("tree", "regular"),
    [
        (leaf([4.0, 5.05, 6.35], 2.0), True),
        (["union", [leaf([4.0, 5.0, 6.0], 2.0), leaf([4.0, 5.0, 6.01], 2.0)]], False),
        (leaf([4.0, 5.0, 6.0], 2.123), False),
        (leaf([4.0, 5.0, 6.0], 2.123, turned=True), True),  # where a turned part stands is nobody's choice
    ],
)
def test_sources_on_the_grid_are_told_apart(tree, regular):
    assert editable.is_regular(tree) == regular


def test_parts_whose_sources_are_off_the_grid_are_left_out_of_the_last_line(tmp_path, capsys):
    written(PLATE, tmp_path / "plate")
    written(box(80.0, 50.0, 6.0), tmp_path / "bar")
    (tmp_path / "trees.json").write_text(json.dumps({"plate": leaf([80.0, 50.123, 6.0], 0.0), "bar": leaf([80.0, 50.0, 6.0], 0.0)}))
    sys.argv = ["editable.py", str(tmp_path), "--sources", str(tmp_path / "trees.json")]
    assert editable.main() == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("| 1 whose sources are on the grid | 3 | 3 (100%)")


def test_outlines_and_nesting_are_counted(tmp_path, capsys):
    drawn = Primitive("extrude", (5.0,), (0.0, 0.0, 5.5), outline=Outline((circle(9.0),)))
    deep = combine_all(
        "union", [combine_all("difference", [combine_all("union", [PLATE, drawn]), cylinder(1.0, 30.0)]), box(1.0, 1.0, 9.0)]
    )
    found = editable.read(written(deep, tmp_path / "deep") / "program.json")
    assert (found.depth, found.outlines, found.settled_outlines) == (4, 1, 1)
    sys.argv = ["editable.py", str(tmp_path)]
    assert editable.main() == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith(f"| all 1 | {found.numbers} | {found.on_grid} (")


def test_lost_iou_and_loose_bodies_are_told(tmp_path, capsys):
    to_trimesh(to_manifold(PLATE)).export(tmp_path / "plate.stl")
    folder = written(combine_all("union", [PLATE, box(1.0, 1.0, 1.0, (0.0, 0.0, 20.0))]), tmp_path / "out" / "plate")
    told = {"input": str(tmp_path / "plate.stl"), "found": {"volume_iou": 0.9999}, "scores": {"volume_iou": 0.9997}}
    (folder / "report.json").write_text(json.dumps(told))
    found = editable.read(folder / "program.json")
    assert (found.crumbs, found.iou_loss) == (1, pytest.approx(2e-4))
    sys.argv = ["editable.py", str(tmp_path / "out")]
    assert editable.main() == 0
    assert capsys.readouterr().out.splitlines()[-1].endswith("| 0.00020 | 1 |")
    (folder / "report.json").write_text(json.dumps(told | {"input": "gone.stl", "scores": {"volume_iou": None}}))
    assert editable.read(folder / "program.json")[6:] == (None, None)


def test_a_picture_of_an_edit(tmp_path, capsys):
    folder, picture = written(PLATE, tmp_path / "plate"), tmp_path / "edit.png"
    arguments = [str(folder / "mesh.stl"), str(folder), "plate_thickness=12", "--out", str(picture)]
    assert make_edit_picture.main(arguments) == 0
    panels = Image.open(picture).convert("L")
    side, top = make_edit_picture.SIDE, make_edit_picture.HEADER
    left, right = (panels.crop((x, top, x + side, top + side)) for x in (0, panels.width - side))
    assert left.getextrema()[0] < 200
    assert left.tobytes() != right.tobytes()
    assert make_edit_picture.main([*arguments[:2], "plate_thicknes=12", "--out", str(tmp_path / "no.png")]) == 2
    assert "nearest are plate_thickness" in capsys.readouterr().err
    assert not (tmp_path / "no.png").exists()


@pytest.mark.parametrize("value", [1.0, 0.5, -2.0, 3.0, 1.5, 0.25, -0.43301270189])
def test_plain_coefficients_are_not_odd(value):
    assert not editable.is_odd(value)


@pytest.mark.parametrize("value", [1.25, 0.3, 0.087])
def test_other_coefficients_are_odd(value):
    assert editable.is_odd(value)
