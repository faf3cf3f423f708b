"""The stated interval of each name: it holds the part's number, is said in words, and is stated of noisy clouds alone."""

import json

import numpy as np
import pytest
from tests.drawn import BRACKET
from tests.planted import box, cut

from imdim.delivery.deliver import deliver
from imdim.delivery.finish import finish
from imdim.delivery.intervals import StatedInterval, state_intervals, with_remarks
from imdim.delivery.report import RunRecord
from imdim.export.openscad_reader import read_openscad
from imdim.geometry.sampling import surface_points
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.tree import Primitive
from imdim.relations.discover import exact_relations
from imdim.target.target import target_from

PLATE = cut(box(60, 40, 6), Primitive("cylinder", (5.0, 12.0), (15.0, 5.0, 0.0)))
SIGMA = 0.3


def noisy(program, seed=0):
    rng = np.random.default_rng(seed)
    return target_from(surface_points(program, 8000, rng)[0] + rng.normal(0, SIGMA, (8000, 3)), "plate")


def finished(program):
    found = exact_relations(program)
    return finish(found.program, found.constraints)


def test_names_are_measured_where_the_points_are_and_not_where_the_program_is():
    off = cut(box(60.2, 39.9, 6.05), Primitive("cylinder", (5.1, 12.0), (15.05, 5.0, 0.0)))
    stated = state_intervals(finished(off), noisy(PLATE))
    truth = {"plate_length": 60.0, "plate_width": 40.0, "plate_thickness": 6.0, "m12_tap_hole_diameter": 10.0}
    assert truth.keys() <= stated.keys()
    for name, value in truth.items():
        assert abs(stated[name].measured - value) < 1.3 * stated[name].half
        assert stated[name].half < 0.15
    assert stated["plate_length"].value == pytest.approx(60.2)
    assert not stated["plate_length"].snapped  # the interval does not hold it


def test_the_dimensions_of_an_outline_have_intervals():
    bracket = Primitive("extrude", (8.0,), outline=BRACKET)
    found = finished(bracket)
    stated = [state_intervals(found, noisy(bracket, seed)) for seed in range(4)]
    assert min(map(len, stated)) >= 0.8 * len(found.parameters.values)
    off = [abs(i.measured - i.value) / i.half for one in stated for i in one.values()]
    assert np.mean(np.array(off) <= 1) >= 0.85
    assert max(off) < 2


@pytest.mark.parametrize(
    ("interval", "words"),
    [
        (StatedInterval(8.0, 7.987, 0.0124, True), "8 (measured 7.987 +- 0.012)"),
        (StatedInterval(7.99, 7.9871, 0.0124, False), "7.987 +- 0.012"),
        (StatedInterval(1200.0, 1203.4, 26.0, True), "1200 (measured 1203 +- 26)"),
    ],
)
def test_an_interval_in_words(interval, words):
    assert str(interval) == words


def test_remarks_stand_above_snapped_names_and_change_no_number():
    text = "$fn = 96;\n\nplate_length = 60;\nplate_length_2 = 7.5;\n\ncube([plate_length, plate_length_2, 1], center = true);\n"
    stated = {"plate_length": StatedInterval(60.0, 60.013, 0.02, True), "plate_length_2": StatedInterval(7.5, 7.51, 0.2, False)}
    remarked = with_remarks(text, stated)
    assert remarked == text.replace("plate_length = 60;", "// 60 (measured 60.013 +- 0.02)\nplate_length = 60;", 1)
    assert read_openscad(remarked) == read_openscad(text)


@pytest.mark.usefixtures("without_step")
def test_the_report_states_them_of_noisy_clouds_alone(tmp_path):
    deliver(PLATE, noisy(PLATE), tmp_path / "noisy", RunRecord("plate.xyz", {}, "finished", 0, noisy=True))
    report = json.loads((tmp_path / "noisy/report.json").read_text())
    # the program is the part, so that whatever is stated holds it but for one time in twenty
    stated = report["intervals"]
    assert stated["plate_length"]["snapped"]
    assert stated["plate_length"]["says"].startswith("60 (measured ")
    assert f"// {stated['plate_length']['says']}\n" in (tmp_path / "noisy/program.scad").read_text()
    exact = target_from(to_trimesh(to_manifold(PLATE)))
    assert "intervals" not in deliver(PLATE, exact, tmp_path / "exact", RunRecord("plate.stl", {}, "finished", 0))
