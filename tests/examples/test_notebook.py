"""The notebook: its cells run in order, it holds no output, and what it promises is written.

Its cells are run in this process, with the answer of the search taken from `examples`: a kernel of its own would bring twenty packages,
and would search for a minute.
"""

import ast
import json
from pathlib import Path

import pytest
from tests.bundled import find_bracket_at_once

from imdim.program.codec import loads
from imdim.program.tree import Program

ROOT = Path(__file__).parents[2]
NOTEBOOK = json.loads((ROOT / "examples/first_fit.ipynb").read_text(encoding="utf-8"))
CELLS = ["".join(cell["source"]) for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]


def run(cells: list[str]) -> list[str]:
    """Run cells as a notebook does; the page of each whose last line is a value that has one."""
    names, shown = {"__name__": "__main__"}, list[str]()
    for number, cell in enumerate(cells):
        *before, last = ast.parse(cell).body
        whole = [*before] if isinstance(last, ast.Expr) else [*before, last]
        exec(compile(ast.Module(whole, []), f"cell {number}", "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), f"cell {number}", "eval"), names)
            shown += [value._repr_html_()] if hasattr(value, "_repr_html_") else []
    return shown


@pytest.mark.parametrize("started_in", ["examples"])  # a story of tests/stories starts in the checkout itself
def test_its_cells_run_in_order(started_in, tmp_path, monkeypatch, capsys):
    find_bracket_at_once(tmp_path, monkeypatch)
    home = tmp_path / started_in
    home.mkdir(exist_ok=True)
    monkeypatch.chdir(home)
    (page,) = run(CELLS)
    assert page.startswith("<iframe")
    assert "\nplate_thickness = 8\n" in (said := capsys.readouterr().out)
    assert "first-fit/program.FCMacro" in said
    before, after = (loads((home / "out" / name / "program.json").read_bytes()) for name in ("first-fit", "first-fit-thicker"))
    assert isinstance(before, Program)
    assert before != after
    scad = (home / "out/first-fit-thicker/program.scad").read_text()
    assert "\nplate_thickness = 10; // [5:0.1:20]\n" in scad


def test_it_holds_no_output():
    assert (NOTEBOOK["nbformat"], NOTEBOOK["nbformat_minor"]) == (4, 5)
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code")
    assert len({cell["id"] for cell in NOTEBOOK["cells"]}) == len(NOTEBOOK["cells"])
    assert "(examples/first_fit.ipynb)" in (ROOT / "README.md").read_text(encoding="utf-8")
