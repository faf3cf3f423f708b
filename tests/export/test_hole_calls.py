"""Holes as build123d's operations: which become calls, and that the script, run by build123d itself, makes the solid it made before."""

import math
import re
import subprocess

import pytest
from tests.deadlines import PASSED
from tests.export.test_outlines import interpreter

from imdim.deadline import NEVER
from imdim.delivery.finish import FinishedProgram, finish
from imdim.export import hole_calls
from imdim.export.script import to_script
from imdim.geometry.solid import to_manifold
from imdim.program.tree import Combine, Primitive, Program, combine_all
from imdim.reconstruction.fitting import relations_of

PLATE = Primitive("box", (40.0, 30.0, 10.0))
BORE = Primitive("cylinder", (2.0, 10.0))


def drilled(*cutters: Primitive, body: Program = PLATE) -> Program:
    return combine_all("difference", [body, *cutters])


def cone(bottom: float, top: float, height: float, level: float) -> Primitive:
    return Primitive("cone", (bottom, top, height), (0.0, 0.0, level))


SUNK = math.pi * 2.0 / 3 * (4 + 8 + 16)  # from radius 4 to 2 in a depth of 2
CASES = {  # a program, the call in its script, and its volume
    "through": (drilled(BORE), "Hole(hole_diameter/2, plate_thickness + 1)", 12000 - 40 * math.pi),
    "blind, from below": (
        drilled(Primitive("cylinder", (3.0, 4.0), (5.0, 2.0, -3.0))),
        "Rot(180, 0, 0) * Hole(hole_diameter/2, hole_depth)",
        12000 - 36 * math.pi,
    ),
    "counterbore": (
        drilled(BORE, Primitive("cylinder", (4.0, 3.0), (0.0, 0.0, 3.5))),
        "CounterBoreHole(hole_diameter/2, counterbore_diameter/2, counterbore_depth, plate_thickness + 1)",
        12000 - 28 * math.pi - 48 * math.pi,
    ),
    "counterbore above a bore that begins at its floor": (
        drilled(Primitive("cylinder", (2.0, 7.0), (0.0, 0.0, -1.5)), Primitive("cylinder", (4.0, 3.0), (0.0, 0.0, 3.5))),
        "CounterBoreHole(",
        12000 - 28 * math.pi - 48 * math.pi,
    ),
    "countersink": (drilled(BORE, cone(2.0, 4.0, 2.0, 4.0)), "CounterSinkHole(", 12000 - 32 * math.pi - SUNK),
    "countersink from below": (drilled(BORE, cone(4.0, 2.0, 2.0, -4.0)), "CounterSinkHole(", 12000 - 32 * math.pi - SUNK),
    "countersink along x": (
        drilled(
            Primitive("cylinder", (2.0, 40.0), rotation=(0.0, 90.0, 0.0)),
            Primitive("cone", (2.0, 4.0, 2.0), (19.0, 0.0, 0.0), (0.0, 90.0, 0.0)),
        ),
        "CounterSinkHole(",
        12000 - 4 * 38 * math.pi - SUNK,
    ),
    "four in a grid": (
        drilled(*(Primitive("cylinder", (2.0, 10.0), (x, y, 0.0)) for x in (-15.0, 15.0) for y in (-10.0, 10.0))),
        "Hole(hole_diameter/2, plate_thickness + 1)",
        12000 - 160 * math.pi,
    ),
}


def finished(program: Program) -> FinishedProgram:
    return finish(*relations_of(program))


def script(found: FinishedProgram) -> str:
    return to_script(found.program, found.parameters, found.folded)


def volume(text: str, folder) -> float:
    (folder / "program.py").write_text(text + "\nprint(part.volume)\n")
    command = [interpreter("build123d"), "program.py"]
    return float(subprocess.run(command, check=True, cwd=folder, timeout=120, capture_output=True, text=True).stdout)


@pytest.mark.parametrize("name", CASES)
def test_a_hole_is_one_call(name):
    program, call, _ = CASES[name]
    text = script(finished(program))
    assert text.count(call) == 1
    assert "Cylinder(" not in text
    assert "Cone(" not in text


@pytest.mark.tool
@pytest.mark.parametrize("name", CASES)
def test_the_calls_make_the_same_solid(name, tmp_path):
    program, _, exact = CASES[name]
    assert volume(script(finished(program)), tmp_path) == pytest.approx(exact, rel=1e-9)


@pytest.mark.tool
def test_calls_follow_the_names(tmp_path):
    """A thicker plate with a wider and deeper counterbore: a through hole goes on to be one."""
    found = finished(CASES["counterbore"][0])
    text = script(found)
    for name, value in {"plate_thickness": 14.0, "counterbore_diameter": 10.0, "counterbore_depth": 5.0}.items():
        text, changed = re.subn(rf"^{name} = .*$", f"{name} = {value:g}", text, flags=re.MULTILINE)
        assert changed == 1
    assert volume(text, tmp_path) == pytest.approx(40 * 30 * 14 - math.pi * (4 * 9 + 25 * 5), rel=1e-9)


OVER = Combine("union", PLATE, Primitive("box", (20.0, 30.0, 4.0), (0.0, 0.0, 12.0)))
BRIDGE = Combine("union", OVER, Primitive("box", (4.0, 30.0, 10.0), (-12.0, 0.0, 9.0)))


@pytest.mark.parametrize(
    "program",
    [
        drilled(BORE, body=BRIDGE),  # a hole under a bridge, which the call would go through as well
        drilled(Primitive("cylinder", (2.0, 40.0), rotation=(0.0, 30.0, 0.0))),  # aslant
        Combine("union", PLATE, Primitive("cylinder", (4.0, 8.0), (0.0, 0.0, 9.0))),  # a boss
    ],
    ids=["under a bridge", "aslant", "boss"],
)
def test_other_cylinders_stay_what_they_are(program):
    text = script(finished(program))
    assert "Cylinder(" in text
    assert "Hole(" not in text


def test_a_hole_under_a_bridge_is_one(tmp_path):
    """Else the case above would say nothing of bridges."""
    assert to_manifold(drilled(BORE, body=BRIDGE)).genus() > to_manifold(BRIDGE).genus()


@pytest.mark.parametrize(("deadline", "asked"), [(NEVER, [2, 1, 1]), (PASSED, [2])], ids=["never", "passed"])
def test_past_the_deadline_holes_are_not_asked_one_by_one(monkeypatch, deadline, asked):
    found, numbers = finished(drilled(*(Primitive("cylinder", (r, 10.0), (8 * r - 20, 0.0, 0.0)) for r in (2.0, 3.0)))), []
    monkeypatch.setattr(hole_calls, "_keeps", lambda _, some, __: numbers.append(len(some)))
    assert "Hole(" not in to_script(found.program, found.parameters, found.folded, deadline=deadline).partition("part =")[2]
    assert numbers == asked
