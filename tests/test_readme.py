"""The README is short, its commands run, and its figures stand in the results."""

import re
import shlex
import tomllib
from pathlib import Path

import pytest
from tests.bundled import find_bracket_at_once

import imdim
from imdim.app import cli
from imdim.export.folder import FILES
from imdim.geometry.solid import to_manifold
from imdim.program.codec import loads
from imdim.target.readers import FORMATS

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
COMMANDS = [line for block in re.findall(r"^```sh slow\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL) for line in block.splitlines()]
MOST_WORDS = 800


@pytest.fixture
def reader(tmp_path, monkeypatch):
    """A folder with the bundled part, in which the program that the search finds of it is found at once."""
    find_bracket_at_once(tmp_path, monkeypatch)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_it_is_short_and_names_nothing_that_is_not_there():
    words = re.findall(r"[\w.-]*\w[\w.-]*", re.sub(r"\]\([^)]*\)", "]", TEXT))
    assert len(words) < MOST_WORDS
    links = re.findall(r"\]\(([^)#]*)(?:#[^)]*)?\)", TEXT)
    assert [link for link in links if "://" not in link and not (ROOT / link).exists()] == []
    assert set(re.findall(r"`((?:program|mesh|report|front|preview)[\w.]*\.\w+)`", TEXT)) == {*FILES} - {"edit.png"}


def test_what_it_promises_can_be_typed():
    for command in ("python pretrain.py", "tensorboard --logdir runs", "python infer.py", "python scripts/bench/evaluate.py"):
        assert any(line.startswith(command) for line in COMMANDS), command
    for name in ("make demo", "make test"):
        assert f"`{name}`" in TEXT
        assert re.search(rf"^{name.split()[1]}:", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    for words in map(shlex.split, COMMANDS):
        assert words[0] != "python" or (ROOT / words[1]).is_file(), words
        assert words[0] != "imdim" or words[1] in cli.COMMANDS, words
    for extras in re.findall(r"pip install \"\.\[(\w+)\]", TEXT):
        assert extras in EXTRAS
    mentioned = re.findall(r"It reads (.*?) clouds", TEXT, re.DOTALL)[0]
    assert {f".{name.lower()}" for name in re.findall(r"\b[A-Z0-9]{3,4}\b", mentioned)} <= {*FORMATS}


def test_the_first_commands_fit_and_edit_the_bundled_part(reader, capsys):
    for line in COMMANDS:
        if line.startswith("imdim "):
            assert cli.main(shlex.split(line)[1:]) == 0, line
    before, after = (loads((reader / name / "program.json").read_bytes()) for name in ("bracket.imdim", "thicker"))
    (low, high), (low2, high2) = ((box[2], box[5]) for box in (to_manifold(p).bounding_box() for p in (before, after)))
    assert (high2 - low2) - (high - low) == pytest.approx(2.0), "the plate is 2 thicker, and all else rises with it"
    assert "in kind as before" in capsys.readouterr().out


def test_the_lines_of_python_run(reader, capsys):
    (block,) = re.findall(r"^```python\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)
    exec(compile(block, "README.md", "exec"), {})
    assert "plate_thickness = 8;" in capsys.readouterr().out
    assert imdim.load_target(reader / "out/from-python/mesh.stl").is_solid


def test_figures_are_those_of_the_results():
    """Each row names a commit; the results tell of that commit, and hold the row's figures."""
    results = (ROOT / "benchmarks/results.md").read_text(encoding="utf-8") + (ROOT / "docs/comparison.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (?!parts|---)(.*) \| ([0-9a-f]{7}) \|$", TEXT, re.MULTILINE)
    assert len(rows) == 5
    for row, commit in [*rows, ("99 90", "93fc7ed")]:
        assert commit in results, commit
        for figure in re.findall(r"\b\d[\d.,]*\d of \d+\b|\b\d+\.\d{1,2}\b", row.replace("0.5 % noise", "")):
            assert figure in results, f"{row}: {figure}"
