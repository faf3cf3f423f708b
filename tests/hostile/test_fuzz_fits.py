"""The fuzzing of fits: its cases repeat, what goes wrong in a fit is found, and two real cases come to an end."""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh

from imdim.program.tree import Combine, Primitive
from imdim.reconstruction.pipeline import Snapshot
from imdim.target.target import InputError

SCRIPTS = Path(__file__).parents[2] / "scripts" / "fuzz"
sys.path += [str(SCRIPTS), str(SCRIPTS.with_name("bench"))]  # the scripts import each other by name

import fit_cases as fuzz  # noqa: E402

CASE = fuzz.Case(np.zeros((60, 3)), trimesh.creation.box((2.0, 2.0, 2.0)), fuzz.Settings(), "a stand-in")
BOX = Primitive("box", (2.0, 2.0, 2.0))


def led_to(monkeypatch, act) -> str:
    monkeypatch.setattr(fuzz, "fitted", act)
    return fuzz.tried(CASE)


def answer(program):
    return lambda case: Snapshot("finished", program, 0.0, 1.0)


def broken(error):
    def act(case):
        raise error

    return act


def warned(case):
    warnings.warn("overflow", RuntimeWarning, stacklevel=1)
    return answer(BOX)(case)


def test_a_case_is_a_function_of_seed_and_number():
    cases = [[fuzz.drawn(3, i, 5.0) for _ in range(2)] for i in range(2, 12)]  # the first two are planted for seconds
    for a, b in cases:
        arrays = [case.given.triangles if isinstance(case.given, trimesh.Trimesh) else case.given for case in (a, b)]
        assert (a.told, a.settings) == (b.told, b.settings)
        assert np.array_equal(*arrays)
    assert len({a.told for a, _ in cases}) == 10


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (answer(BOX), "solid: IoU 1.000, 1 primitives"),
        (broken(InputError("part: no inside found")), "refused: part"),
        (broken(InputError("part:\nno inside found")), "FOUND: a refusal of several lines"),
        (broken(ZeroDivisionError("division by zero")), "FOUND: ZeroDivisionError: division by zero at test_fuzz_fits.py"),
        (warned, "FOUND: a warning, overflow"),
        (answer(Combine("difference", BOX, Primitive("box", (3.0, 3.0, 3.0)))), "FOUND: no solid"),
        (answer(Primitive("box", (2.0, 2.0, 2.0), (40.0, 0.0, 0.0))), "FOUND: a solid elsewhere"),
    ],
)
def test_what_a_fit_leads_to(monkeypatch, act, said):
    assert led_to(monkeypatch, act).startswith(said)


def test_two_real_cases():
    command = [sys.executable, str(SCRIPTS / "fits.py"), "--seed", "1", "--first", "28", "--cases", "2", "--longest", "4"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 cases, seed 1: 2 solid" in done.stdout
