"""The house keeps its rules: one meaning for a class name, verbs for functions, one place for frames, one row for each layer."""

import ast
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))

import house
import pytest
from tests.conftest import LONGEST, TESTS

MOST_DOUBLED, MOST_PARTICIPLES = 1, 6
MOST_CONVERSIONS = 6  # the front and the rounding of numbers, which are judged in both frames, and the lab, which has no other door


@pytest.fixture(scope="module")
def modules():
    return house.parse_modules(house.SOURCE)


def test_a_class_name_means_one_thing(modules):
    assert len(house.doubled_classes(modules)) <= MOST_DOUBLED


def test_public_functions_are_verbs(modules):
    public = [name for name in house.participle_functions(modules) if not house.is_private(name)]
    assert len(public) <= MOST_PARTICIPLES, public


def test_frames_are_converted_in_one_place():
    pipeline, every = house.count_conversions(house.SOURCE)
    assert every - pipeline <= MOST_CONVERSIONS


def test_no_row_of_the_layers_lets_neighbours_import_each_other():
    assert house.count_open_rows(house.ROOT / "pyproject.toml") == 0


def test_a_module_says_in_one_line_what_it_is(modules):
    assert house.without_sentence(modules) == []


def test_files_that_begin_first_are_there():
    assert [name for name in LONGEST if not (TESTS / name).exists()] == []


def test_what_breaks_a_rule_is_seen(tmp_path):
    tree = ast.parse("class A:\n    def told(self): ...\n    @property\n    def shown(self): ...\ndef _seen(): ...\ndef snap(): ...")
    modules = {"one": tree, "two": ast.parse("class A: ...")}
    assert house.doubled_classes(modules) == {"A": ["one", "two"]}
    assert house.participle_functions(modules) == ["one:A.told", "one:_seen"]
    said = {"one": ast.parse('"""Whole.\\n\\nMore."""'), "two": ast.parse('"""Half of\\na line."""'), "three": ast.parse("")}
    assert house.without_sentence(said) == ["two", "three"]
    project = tmp_path / "pyproject.toml"
    project.write_text('[[tool.importlinter.contracts]]\nlayers = ["a : b", "c | d"]\n')
    assert house.count_open_rows(project) == 1
