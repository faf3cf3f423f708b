"""Names and colours in STEP files, re-read by OpenCASCADE's reader of documents."""

import re
from collections import Counter

import pytest
from tests.export.blended import BOX, RIM, fillet
from tests.planted import box, cut, cylinder, union

from imdim.delivery.deliver import RunRecord, deliver, export
from imdim.export.part_names import ADDED, BLENDED, CUT, PartNames, spell
from imdim.export.step import write_step
from imdim.export.step_booleans import ocp
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.codec import Meta
from imdim.target.target import target_from

pytest.importorskip("OCP", reason="the extra [step] is not installed")

PLATE = cut(box(80, 50, 6), cylinder(3, 8, (-20, 0, 0)), cylinder(3, 8, (20, 0, 0)))


def read(path):
    """The name of the product, and the names and colours of its faces with how often each is there."""
    text = ocp("TCollection").TCollection_ExtendedString
    document = ocp("TDocStd").TDocStd_Document(text("BinXCAF"))
    reader, settings, tools = ocp("STEPCAFControl").STEPCAFControl_Reader(), ocp("Interface").Interface_Static, ocp("XCAFDoc")
    settings.SetIVal_s("read.stepcaf.subshapes.name", 1)
    assert reader.ReadFile(str(path)).name.endswith("RetDone")
    assert reader.Transfer(document)
    shapes, colours = (getattr(tools.XCAFDoc_DocumentTool, f"{what}Tool_s")(document.Main()) for what in ("Shape", "Color"))
    roots, faces = (ocp("collections").Sequence_TDF_Label() for _ in range(2))
    shapes.GetFreeShapes(roots)
    assert roots.Length() == 1
    shapes.GetSubShapes_s(roots.Value(1), faces)
    found = Counter()
    for i in range(1, faces.Length() + 1):
        colour = ocp("Quantity").Quantity_Color()
        assert colours.GetColor(shapes.GetShape_s(faces.Value(i)), tools.XCAFDoc_ColorSurf, colour)
        found[name_of(faces.Value(i)), tuple(round(v, 2) for v in colour.Values(ocp("Quantity").Quantity_TOC_sRGB))] += 1
    return name_of(roots.Value(1)), found


def name_of(label):
    name = ocp("TDataStd").TDataStd_Name()
    assert label.FindAttribute(ocp("TDataStd").TDataStd_Name.GetID_s(), name)
    return name.Get().ToExtString()


def test_faces_are_called_as_the_features_that_made_them(tmp_path):
    write_step(PLATE, tmp_path / "part.step", names=PartNames.of(PLATE, "Müller's plate"))
    assert read(tmp_path / "part.step") == ("Muller's plate", {("plate", ADDED): 6, ("hole", CUT): 1, ("hole2", CUT): 1})
    head = (tmp_path / "part.step").read_text().split("ENDSEC")[0]
    assert "FILE_NAME('Muller''s plate','1970-01-01T00:00:00',(''),(''),'OpenCASCADE','IMDIM','');" in head
    assert "Author" not in head


def test_blends_have_a_name_and_a_colour(tmp_path):
    write_step(BOX, tmp_path / "part.step", [fillet(2.0, RIM[:1])])
    assert read(tmp_path / "part.step")[1] == {("body", ADDED): 6, ("blend", BLENDED): 1}


def test_several_solids_are_one_part(tmp_path):
    apart = union(box(10, 20, 30), box(5, 5, 48, (40.0, 0.0, 0.0)))
    write_step(apart, tmp_path / "part.step")
    name, faces = read(tmp_path / "part.step")
    assert (name, sum(faces.values())) == ("part", 12)


def test_what_is_delivered_is_called_as_the_part(tmp_path):
    target = target_from(to_trimesh(to_manifold(PLATE)), "bench plate.stl")
    deliver(PLATE, target, tmp_path / "out", RunRecord("plate.stl", {}, "finished", 0), step_limit_s=60.0)
    assert read(tmp_path / "out/program.step")[0] == "bench plate"
    assert export(PLATE, tmp_path / "simple", Meta(), step_limit_s=60.0)["program.step"] == "written"
    assert read(tmp_path / "simple/program.step")[0] == "simple"


def test_only_letters_that_every_reader_knows():
    assert spell(" Größe\n1 mm ") == "Gro_e_1 mm"
    assert PartNames.of(PLATE, "\n").part == "_"
    assert PartNames.of(PLATE, "").part == "part"
    assert re.fullmatch(r"[ -~]+", spell("näßé📐"))
