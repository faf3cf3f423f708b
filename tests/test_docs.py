"""What the documentation says is so: its code runs, its files are there, and its lists are those of the code."""

import ast
import json
import re
import runpy
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from imdim.app import cli
from imdim.delivery.deliver import RunRecord, deliver
from imdim.delivery.evaluate import evaluate
from imdim.program.constraints import RULES
from imdim.program.front import loads
from imdim.program.node_codec import REPEAT_FIELDS
from imdim.program.state import Token
from imdim.program.tree import SIZE_NAMES
from imdim.reconstruction.fitting import relations_of
from imdim.target.target import load_target

ROOT = Path(__file__).parents[1]
PAGES = sorted([*(ROOT / "docs").glob("*.md"), ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", ROOT / "README.md"])
WRITTEN = [page for page in PAGES if page.name != "trust.md"]
RUN = [
    page for page in WRITTEN if page.name != "README.md" and re.search(r"^```(python|sh)$", page.read_text(encoding="utf-8"), re.MULTILINE)
]
BLOCK = re.compile(r"^```(\w+)( slow)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SHARED = ("dataset", "examples", "scripts", "models", "configs", "infer.py", "pretrain.py", "reinforce.py")
GIVEN = {"np": np, "torch": torch, "trimesh": trimesh, "Path": Path}


@pytest.fixture(scope="module")
def bracket(tmp_path_factory):
    """A folder as a reader has it after the first command of the gallery, with the search's answer taken from `examples`."""
    home = tmp_path_factory.mktemp("reader")
    for name in SHARED:
        (home / name).symlink_to(ROOT / name)
    choices, _ = loads((ROOT / "examples/bracket_front.json").read_bytes())
    target = load_target(ROOT / "dataset/examples/bracket.stl")
    program, constraints = relations_of(choices[5].program)
    front = [*choices[:5], type(choices[5])(program, choices[5].error), *choices[6:]]
    record = RunRecord("dataset/examples/bracket.stl", {}, "finished", 0)
    deliver(program, target, home / "out/bracket", record, step_limit_s=0.0, constraints=constraints, front=front)
    assert evaluate(program, target).volume_iou > 0.9999
    return home


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_the_blocks_of_a_page_run_in_order(page, bracket, monkeypatch, capsys):
    monkeypatch.chdir(bracket)
    monkeypatch.delenv("PYTEST_CURRENT_TEST", raising=False)
    names = {"__name__": "docs", **GIVEN}
    for language, slow, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        if language == "python" and not slow:
            exec(compile(text, str(page), "exec"), names)
        elif language == "sh" and not slow:
            for line in text.splitlines():
                execute(shlex.split(line), monkeypatch)
    assert "Traceback" not in capsys.readouterr().err


def execute(words, monkeypatch):
    """A command line of the documentation, in this process; fails unless its exit status is 0."""
    status = None
    if words[0] == "imdim":
        assert cli.main(words[1:]) == 0, words
        return
    assert words[0] == "python"
    script = Path(words[1])
    monkeypatch.setattr(sys, "argv", words[1:])
    monkeypatch.syspath_prepend(str(script.resolve().parent))
    try:
        runpy.run_path(str(script), run_name="__main__")
    except SystemExit as ending:
        status = ending.code
    assert not status, words


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: page.stem)
def test_blocks_that_are_not_run_name_what_is_there(page):
    for language, _, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        assert language in ("python", "sh", "json", "text"), f"{page.name}: a block of {language} is not checked"
        if language == "python":
            compile(text, str(page), "exec")
        if language == "json":
            json.loads(text)
        for words in map(shlex.split, text.splitlines() if language == "sh" else ()):
            assert words[0] != "imdim" or words[1] in cli.COMMANDS, words
            assert words[0] != "python" or (ROOT / words[1]).is_file(), words


def test_commands_that_are_set_in_without_a_fence_name_what_is_there():
    """Of pages of measurements, whose commands take minutes or hours."""
    lines = [
        line
        for page in PAGES
        for line in re.findall(r"^    (?:\w+=\S+ )*((?:python|imdim) .*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    ]
    assert len(lines) > 15
    for words in (line.split() for line in lines):
        assert words[0] != "imdim" or words[1] in cli.COMMANDS, words
        assert words[0] != "python" or words[1] == "-m" or (ROOT / words[1]).is_file(), words


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: page.stem)
def test_links_and_files_are_there(page):
    text = page.read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)#]*)(?:#[^)]*)?\)", text):
        assert not link or "://" in link or (page.parent / link).exists(), f"{page.name} links to {link}"
    for name in re.findall(r"`((?:src|tests|scripts|configs|dataset|models|examples|benchmarks)/[\w./-]+)`", text):
        assert (ROOT / name).exists() or name.startswith("dataset/train"), f"{page.name} names {name}"


@pytest.mark.parametrize("page", [*PAGES, ROOT / "benchmarks/results.md", ROOT / "models/README.md"], ids=lambda page: page.stem)
def test_code_that_is_named_is_there(page):
    """Every file of code, by the end of its path alone too."""
    there = {f"/{path.relative_to(ROOT)}" for kind in ("src", "scripts", "tests", "examples", "*.py") for path in python_files(kind)}
    spans = " ".join(re.findall(r"`([^`\n]+)`", page.read_text(encoding="utf-8")))
    named = set(re.findall(r"(?<![\w./*-])[\w/-]+\.py\b", spans)) - {"program.py"}
    assert [name for name in named if not any(path.endswith(f"/{name}") for path in there)] == []


WRITTEN_BY_US = {"program.py"}  # a file of results


def test_code_that_comments_name_is_there():
    """Beside the file that names it, or by its path from the package or the root."""
    gone = []
    for path in python_files("src"):
        text = path.read_text(encoding="utf-8")
        docs = [
            ast.get_docstring(node) or ""
            for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        ]
        for name in re.findall(r"(?<![\w./*-])[\w/-]+\.py\b", " ".join([*docs, *re.findall(r"#.*", text)])):
            places = (folder / name for folder in (path.parent, ROOT, ROOT / "src/imdim"))
            gone += [] if name in WRITTEN_BY_US or any(place.is_file() for place in places) else [f"{path.name}: {name}"]
    assert gone == []


def python_files(kind):
    return [path for found in ROOT.glob(kind) for path in ([found] if found.is_file() else found.rglob("*.py"))]


def test_names_of_the_tour_are_those_of_the_code_beside_them():
    tour = (ROOT / "docs/tour.md").read_text(encoding="utf-8")
    blocks = names_in("".join(text for language, _, text in BLOCK.findall(tour) if language == "python"))
    for section in re.split(r"^## ", BLOCK.sub("", tour), flags=re.MULTILINE)[1:]:
        spans = re.findall(r"`([\w./]+)`", section)
        files = [path for path in python_files("src") if any(path.as_posix().endswith(f"/{span}") for span in spans)]
        known = blocks.union(*(names_in(path.read_text(encoding="utf-8")) for path in files))
        asked = {word for span in spans if re.fullmatch(r"[A-Za-z]\w*(\.(?!py|toml|json|md)\w+)?", span) for word in span.split(".")}
        assert asked <= known, section.splitlines()[0]


def names_in(code):
    """All that a text of Python calls by a name, or has as a word in quotes."""
    nodes = list(ast.walk(ast.parse(code)))
    fields = [getattr(node, field, None) for node in nodes for field in ("id", "attr", "arg", "name", "value")]
    return {field for field in fields if isinstance(field, str)}


def test_the_tour_leads_to_every_folder_of_the_code():
    table = (ROOT / "docs/tour.md").read_text(encoding="utf-8").split("\n## ")[1]
    source, named = ROOT / "src/imdim", set()
    for row in re.findall(r"^\|.*\|$", table, re.MULTILINE):
        spans = re.findall(r"`([\w./]+)`", row)
        places = (place for home in spans if home.startswith("src/") for place in (ROOT / home, *(ROOT / home / span for span in spans)))
        named |= {folder for place in places if place.exists() for folder in (place, *place.parents)}
    assert not {init.parent for init in source.rglob("*/__init__.py")} - named


def test_pictures_are_small_and_shown():
    shown = {name for page in WRITTEN for name in re.findall(r"\]\(pictures/([\w.]+)\)", page.read_text(encoding="utf-8"))}
    there = {path.name: path.stat().st_size for path in (ROOT / "docs/pictures").iterdir()}
    assert set(there) == shown
    assert max(there.values()) < 200_000
    assert (ROOT / "docs/lab.gif").stat().st_size < 3_000_000


def test_results_say_of_which_code_they_are():
    """Each section of the results with a table names a commit."""
    sections = re.split(r"^## ", (ROOT / "benchmarks/results.md").read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    tables = [section for section in sections if re.search(r"^\| --- ", section, re.MULTILINE)]
    assert len(tables) > 8
    assert [section.splitlines()[0] for section in tables if not re.search(r"\b(?=\w*\d)[0-9a-f]{7}\b", section)] == []


def test_the_formats_page_lists_what_the_code_knows():
    text = (ROOT / "docs/formats.md").read_text(encoding="utf-8")
    rows = {line.split("|")[1].strip(" `"): line for line in text.splitlines() if line.startswith("| `")}
    for kind, sizes in SIZE_NAMES.items():
        assert re.findall(r"`(\w+)`", rows[kind])[1:] == list(sizes)
    for kind in RULES:
        assert kind in rows
    for kind, fields in REPEAT_FIELDS.items():
        line = next(line for line in text.splitlines() if line.startswith(f"| `{kind}` | `{fields[0]}`"))
        assert set(re.findall(r"`(\w+)`", line)[1:]) == set(fields)
    for token in Token:
        assert f"| `{token.name}` | {token.value} |" in text


def test_the_formats_page_lists_every_file_and_key(bracket):
    from imdim.export.folder import FILES

    text = (ROOT / "docs/formats.md").read_text(encoding="utf-8")
    for name in FILES:
        assert f"`{name}`" in text
    report = json.loads((bracket / "out/bracket/report.json").read_text(encoding="utf-8"))
    section = text[text.index("## report.json") : text.index("## report.html")]
    assert set(report) <= set(re.findall(r"`(\w+)`", section))


def test_the_recipe_for_primitives_names_every_file_that_asks_for_kinds():
    text = (ROOT / "docs/extending.md").read_text(encoding="utf-8")
    source = ROOT / "src/imdim"
    asking = [p for p in source.rglob("*.py") if re.search(r'"(torus|ellipsoid)"', p.read_text(encoding="utf-8"))]
    missing = [name for p in asking if not (name := f"src/imdim/{p.relative_to(source)}").startswith("src/imdim/app/") and name not in text]
    assert missing == []


def test_every_source_that_the_code_names_is_cited():
    """Names with a year in the docstrings and comments of the package, by the first name before the year."""
    cited = (ROOT / "docs/citations.md").read_text(encoding="utf-8")
    author = re.compile(r"([A-ZÖ][a-zöéäåü]+)(?: et al\.)?,?(?: [&a]n?d? [A-Z][a-z]+)?,? \(?((?:19|20)\d\d)\b")
    named = {found for p in (ROOT / "src/imdim").rglob("*.py") for found in author.findall(p.read_text(encoding="utf-8"))}
    assert len(named) > 35
    plain = str.maketrans("Öå", "Oa")
    for name, year in named:
        entry = [e for e in cited.split("\n- ") if year in e and name.translate(plain) in e.translate(plain)]
        assert entry, f"{name} {year}"
