"""Settings are merged, typed and refused where they are misspelt, whichever way they come."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

import imdim
from imdim.reconstruction.config import LANGUAGES, ConfigError, Settings, from_arguments, from_hydra, merge

CONFIGS = Path(__file__).parents[2] / "configs"


@dataclass
class Inner:
    width: int = 8


@dataclass
class Outer:
    name: str = "a"
    inner: Inner = field(default_factory=Inner)


def test_defaults_come_from_the_dataclass():
    assert from_arguments([]) == Settings()
    assert from_hydra(CONFIGS, "infer", []) == Settings()


def test_both_ways_give_the_same_settings():
    arguments = ["input=a.stl", "output=o", "budget_s=5", "seed=3", "size_weight=0.01"]
    expected = Settings(input="a.stl", output="o", budget_s=5.0, seed=3, size_weight=0.01)
    assert from_arguments(arguments) == expected
    assert from_hydra(CONFIGS, "infer", arguments) == expected


def test_typed_arguments_win():
    assert from_arguments(["seed=3"], seed=4).seed == 4


def test_typed_settings_alone_are_read_without_omegaconf():
    code = "import sys; from imdim.reconstruction.config import from_arguments as f; s = f([], input='${x}', budget_s=5.0, seed=2)"
    code += "; print(s.input, s.budget_s, s.seed, 'omegaconf' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["${x}", "5.0", "2", "False"]
    assert from_arguments([], input="${x}", budget_s=5.0, seed=2) == from_arguments(["seed=2"], input="${x}", budget_s=5.0)
    with pytest.raises(ConfigError, match="budget_s"):
        from_arguments([], budget_s="soon")
    with pytest.raises(ConfigError, match="seed"):
        from_arguments([], seed=-1)


def test_nested_parts_are_merged_and_stay_typed():
    assert merge(Outer, {"inner": {"width": 3}}) == Outer("a", Inner(3))


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"nam": "b"}, r"'nam': did you mean name\?"),
        ({"inner": {"with": 1}}, r"'inner\.with': did you mean inner\.width\?"),
        ({"zzz": 1}, "known are name, inner"),
        ({"inner": {"width": "wide"}}, "inner.width: Value 'wide'"),
        ({"inner": 3}, "inner"),
    ],
)
def test_what_does_not_fit_is_one_line(values, said):
    with pytest.raises(ConfigError, match=said) as caught:
        merge(Outer, values)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("budget=4", r"did you mean budget_s\?"),
        ("+sead=1", r"did you mean seed\?"),
        ("seed=1.5", "seed: Value '1.5'"),
        ("seed=1,2", "a sweep was given"),
        ("seed=-1", "at least 0, got -1"),
        ("budget_s=nan", "got nan"),
        ("budget_s=inf", "got inf"),
        ("size_weight=2", r"in 0\.\.1, got 2"),
        ("input=a (1).stl", "quote special characters"),
    ],
)
def test_a_bad_override_is_one_line(override, said):
    with pytest.raises(ConfigError, match=said) as caught:
        from_hydra(CONFIGS, "infer", [override])
    assert "\n" not in str(caught.value)


def test_a_quoted_file_name_may_hold_anything():
    assert from_hydra(CONFIGS, "infer", ["input='my part (1).stl'"]).input == "my part (1).stl"


def test_broken_yaml_in_an_argument_is_one_line():
    with pytest.raises(ConfigError, match="flow sequence"):
        from_arguments(["input=[1"])


def test_an_empty_word_is_an_empty_word():
    assert from_arguments(["checkpoint=", "seed=3"]) == Settings(seed=3)
    with pytest.raises(ConfigError, match="seed"):
        from_arguments(["seed="])


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("language", "unknown language 'step'; known are csg, cad"),
        ("objective", "unknown objective 'step'; known are auto, description, primitives"),
    ],
)
def test_python_refuses_an_unknown_choice_too(key, said):
    with pytest.raises(ConfigError, match=said):
        imdim.reconstruct(np.random.default_rng(0).random((99, 3)), Settings(**{key: "step"}))


@pytest.mark.parametrize("name", ["${oc.env:SECRET}.stl", "\\${oc.env:SECRET}.stl", "\\\\${oc.env:SECRET}", "a ${x} b"])
def test_names_of_files_are_taken_literally(name, monkeypatch):
    """The value of a variable of the environment came into results by the name of a file."""
    monkeypatch.setenv("SECRET", "hunter2")
    assert merge(Settings, {"input": name}).input == name
    assert from_arguments([], input=name).input == name


def test_what_is_counted_goes_by_the_language_unless_it_is_said():
    """Published programs of primitives alone are compared by their number."""
    assert {language: Settings(language=language).counted for language in LANGUAGES} == {"cad": "description", "csg": "primitives"}
    for said in ("description", "primitives"):
        assert {Settings(language=language, objective=said).counted for language in LANGUAGES} == {said}
