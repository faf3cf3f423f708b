"""Settings from files and key=value arguments: which lies over which, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from imdim.app.arguments import from_arguments
from imdim.data.augment import AugmentConfig
from imdim.data.families import FAMILIES
from imdim.data.synthesize import SynthesisConfig
from imdim.learn.reinforce import ReinforceConfig
from imdim.learn.settings import TrainConfig
from imdim.reconstruction.config import ConfigError

CONFIGS = Path(__file__).parents[2] / "configs"
NOISY = AugmentConfig(p_noise=0.5, noise=0.02, p_outliers=0.15, outliers=0.01, p_uneven=0.15, p_missing=0.05, missing=0.2, p_views=0.2)
PLAIN = SynthesisConfig(families=[*FAMILIES])  # type: ignore[arg-type] (YAML has lists)
SCANNED = replace(PLAIN, volume_samples=2048, free_rotation=0.08, tilt=0.3, augment=NOISY)
PREFIXED = replace(
    replace(SCANNED, gt_points=1024, cur_points=256, prefixes=6, p_undo=0.05, p_replace=0.12, p_hidden=0.12, p_shaken=0.35, shake=0.008),
    families=[*FAMILIES, "profile", "ring", "common"],  # type: ignore[arg-type]
    augment=replace(NOISY, p_outliers=0.2, outliers=0.1),
)
THREE_KINDS = ["plate", "bracket", "turned", "pattern", "shell", "free"]
EXPERIMENTS = {
    "base": PREFIXED,
    "seed": replace(PLAIN, gt_points=1024, cur_points=384, prefixes=2, families=THREE_KINDS),
    "stump": replace(SCANNED, n_max=8, gt_points=384, families=THREE_KINDS),
}


def pretraining(*arguments):
    return from_arguments(TrainConfig, arguments, CONFIGS, "pretrain")


def test_every_experiment_has_its_samples():
    assert {path.stem for path in (CONFIGS / "experiment").glob("*.yaml")} == set(EXPERIMENTS)
    for name, samples in EXPERIMENTS.items():
        config = pretraining(f"experiment={name}")
        assert (config.experiment, config.out, config.synthesis) == (name, f"runs/{name}", samples)
    assert pretraining() == pretraining("experiment=base")


def test_arguments_lie_over_the_experiment_over_the_file_over_the_defaults():
    assert (TrainConfig().epochs, TrainConfig().measure_every, TrainConfig().batch_size) == (20, 8, 32)
    config = pretraining("experiment=stump", "lr=0.5", "synthesis.n_max=4")
    assert (config.epochs, config.measure_every, config.batch_size) == (1000, 1, 16)
    assert (config.lr, config.synthesis) == (0.5, replace(EXPERIMENTS["stump"], n_max=4))


def test_reinforcement_learns_from_shorter_samples_of_the_pretraining():
    config = from_arguments(ReinforceConfig, ["undo_limit=2"], CONFIGS, "reinforce")
    assert config.synthesis == replace(pretraining().synthesis, n_max=6)
    assert (config.credit, config.targets, config.reuse, config.undo_limit) == ("move", 16, 1, 2)


def test_without_files_there_are_the_defaults():
    assert from_arguments(TrainConfig, ["out=a (1)[x]"]) == replace(TrainConfig(synthesis=PLAIN), out="a (1)[x]")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("experiment=third", "'third' has no file; known are base, seed, stump"),
        ("experiment=../infer", "has no file"),
        ("experiment=", "has no file"),
        ("batchsize=3", "did you mean batch_size"),
        ("synthesis.n_mx=3", "did you mean synthesis.n_max"),
        ("lr=fast", "lr"),
        ("lr", "key=value"),
        ("lr=[1", "settings lr="),
    ],
)
def test_what_cannot_be_is_one_line(wrong, message):
    with pytest.raises(ConfigError, match=message) as caught:
        pretraining(wrong)
    assert "\n" not in str(caught.value)
