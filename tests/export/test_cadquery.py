"""The CadQuery script, run by CadQuery itself: the six simple kinds, their booleans, and loops with names."""

import re
import subprocess

import pytest
from tests.export.outlined import OUTLINED_PARTS
from tests.export.test_loops import PARTS
from tests.export.test_outlines import interpreter
from tests.known_programs import KNOWN

from imdim.delivery.finish import finish
from imdim.export.cadquery import to_cadquery
from imdim.geometry.solid import volume
from imdim.program.tree import leaves
from imdim.reconstruction.fitting import relations_of

SOLIDS = {name: known for name, known in KNOWN.items() if name != "nothing"}
MEASURE = "\nprint(sum(solid.Volume() for solid in part.solids().vals()))\n"
NURBS = 5e-4  # CadQuery integrates over patches of an ellipsoid without refining them


def measured(text: str, folder, *changes: tuple[str, str]) -> float:
    python = interpreter("cadquery")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "program.py").write_text(text + MEASURE)
    said = subprocess.run([python, "-W", "error::FutureWarning", "program.py"], check=True, cwd=folder, timeout=120, capture_output=True)
    return float(said.stdout)


@pytest.mark.tool
@pytest.mark.parametrize("name", SOLIDS)
def test_cadquery_builds_the_exact_solid(name, tmp_path):
    program, exact = SOLIDS[name]
    assert measured(to_cadquery(program), tmp_path) == pytest.approx(exact, rel=NURBS if name == "ellipsoid" else 1e-8)


@pytest.mark.tool
@pytest.mark.parametrize("name", PARTS)
def test_cadquery_builds_loops(name, tmp_path):
    found = finish(*relations_of(PARTS[name]))
    text = to_cadquery(found.program, found.parameters, found.folded)
    assert "reduce(mul, " in text if name in ("lens", "knob") else "reduce(add, " in text
    assert measured(text, tmp_path) == pytest.approx(volume(found.program, 512), rel=1e-4)


@pytest.mark.tool
def test_a_count_and_a_radius_are_changed_at_the_head(tmp_path):
    found = finish(*relations_of(PARTS["row"]))
    text = to_cadquery(found.program, found.parameters, found.folded)
    before = measured(text, tmp_path)
    plate = 90 * 20 * 8
    holes = found.parameters.counts["hole_count"]
    (tmp_path / "more").mkdir()
    diameter = found.parameters.values["hole_diameter"]
    after = measured(
        text,
        tmp_path / "more",
        (f"hole_count = {holes}", f"hole_count = {holes - 1}"),
        (f"hole_diameter = {diameter:g}", "hole_diameter = 2"),
    )
    each = (plate - before) / holes
    assert plate - after == pytest.approx((holes - 1) * each * (2 / diameter) ** 2, rel=1e-6)


@pytest.mark.parametrize("name", [*SOLIDS, *OUTLINED_PARTS])
def test_the_script_is_python_with_one_line_per_primitive(name):
    program = {**SOLIDS, **OUTLINED_PARTS}[name][0]
    text = to_cadquery(program)
    compile(text, "program.cq.py", "exec")
    lines = text[text.index("part = (") :].splitlines()
    shapes = r"\W*(cq\.Workplane|make_cone|make_ellipsoid|extruded|turned|drafted)\(.*"
    assert sum(bool(re.fullmatch(shapes, line)) for line in lines) == sum(1 for _ in leaves(program))
