"""The script that draws OpenSCAD's own parts asks for each by name, and says in one line what is not there."""

import importlib.util
import stat
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "scripts" / "bench" / "openscad_parts.py"


@pytest.fixture
def parts():
    spec = importlib.util.spec_from_file_location("openscad_parts", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def stand_in(folder: Path) -> Path:
    """A program in OpenSCAD's place, which copies its text."""
    script = folder / "openscad"
    script.write_text('#!/bin/sh\ncp "$3" "$2"\n')
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    return script


def test_each_part_is_drawn_of_its_own_text(parts, tmp_path):
    for example in parts.EXAMPLES:
        source = tmp_path / "share" / "examples" / f"{example}.scad"
        source.parent.mkdir(parents=True, exist_ok=True)
        source.write_text(example)
    out = tmp_path / "out"
    assert parts.main([str(out), "--openscad", str(stand_in(tmp_path)), "--share", str(tmp_path / "share")]) == 0
    assert len(list(out.iterdir())) == len(parts.MCAD) + len(parts.EXAMPLES)
    assert (out / "beam.stl").read_text() == "include <MCAD/gridbeam.scad>\n$fn = 32; zBeam(4);\n"
    assert (out / "sign.stl").read_text() == "Parametric/sign"


@pytest.mark.parametrize("lacks", ["openscad", "examples"])
def test_what_is_not_there_is_told_in_one_line(parts, tmp_path, capsys, lacks):
    program = tmp_path / "none" if lacks == "openscad" else stand_in(tmp_path)
    assert parts.main([str(tmp_path / "out"), "--openscad", str(program), "--share", str(tmp_path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("openscad_parts: ")
