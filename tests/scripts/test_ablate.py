"""The ablation's table, on runs of one step."""

import json
import sys
from pathlib import Path

import pytest

from imdim.app.arguments import from_arguments
from imdim.learn.settings import TrainConfig
from imdim.reconstruction.config import ConfigError

SCRIPTS = Path(__file__).parents[2] / "scripts" / "bench"
CONFIGS = SCRIPTS.parents[1] / "configs"
sys.path.insert(0, str(SCRIPTS))  # the scripts import each other by name

import ablate  # noqa: E402
from ablate import VARIANTS, chosen, main, row_of  # noqa: E402


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_differs_from_all_changes_in_one_thing(name):
    plain, other = (from_arguments(TrainConfig, [*ablate.SETTING, *VARIANTS[n]], CONFIGS, "pretrain") for n in ("all changes", name))
    assert (plain == other) == (name == "all changes")
    assert plain.synthesis.n_max == other.synthesis.n_max
    chances = ("p_noise", "p_outliers", "p_uneven", "p_missing")
    assert not any(getattr(v.synthesis.augment, p) for v in (plain, other) for p in chances)


def test_variants_are_chosen_by_words():
    assert chosen([]) == list(VARIANTS)
    assert chosen(["canonical", "all"]) == ["all changes", "without canonical order", "without canonical numbers"]
    with pytest.raises(ConfigError, match="no variant has 'attention' in its name"):
        chosen(["attention"])


def test_a_row_tells_what_was_measured():
    answers = {"greedy": {"median": 0.5, "mean": 0.4}, "beam 16": {"median": 0.75, "mean": 0.7, "exact_structure": 0.25}}
    results = {"token_accuracy": 0.625, "errors": {"turned": {"angle_deg": 12.34}}, "answers": answers}
    line = row_of("all changes", {"steps": 7, "1-6": results})
    assert line == "| all changes | 7 | 0.625 | 12.3 deg | 0.500 (0.400) | 0.750 (0.700) | 25% |"


def test_the_command_trains_measures_and_keeps_the_numbers(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(ablate, "CARD_TARGETS", 4)
    said = []
    arguments = ["minutes=0.0001", "n=2", "only=[pointing]", "batch_size=6", "precision=float32", f"out={tmp_path}"]
    assert main(arguments, CONFIGS, said.append) == 0
    rows = json.loads((tmp_path / "ablation.json").read_text())["rows"]
    assert said[-1] == row_of("without pointing at marks", rows["without pointing at marks"])
    assert len(rows["without pointing at marks"]["1-6"]["answers"]["beam 16"]["ious"]) == 2
    assert (tmp_path / "without_pointing_at_marks" / "best.safetensors").is_file()
    for wrong, message in (("minuts=3", "did you mean minutes"), ("only=[xyz]", "no variant has 'xyz'")):
        assert main([wrong], CONFIGS, said.append) == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1
