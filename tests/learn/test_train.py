"""Training runs: resuming, stopping, files; checkpoints that refuse what they are not."""

import errno
import json
import math
from dataclasses import replace

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from imdim.app.arguments import from_arguments
from imdim.config import ConfigError
from imdim.data.folder import FolderConfig, make_folder
from imdim.data.synthesize import SynthesisConfig
from imdim.learn import checkpoint
from imdim.learn.base import BaseConfig
from imdim.learn.checkpoint import CheckpointError, load_policy, load_state, save_policy
from imdim.learn.seed import SeedConfig
from imdim.learn.train import NotFinite, TrainConfig, build, train

BASE = BaseConfig(
    d_model=16, encoder_layers=1, decoder_layers=1, heads=2, gt_points=64, cur_points=32, gt_patches=4, cur_patches=4, neighbours=4
)
SEED = SeedConfig(d_model=16, layers=1, heads=2, hidden=16)
DATA = SynthesisConfig(gt_points=64, cur_points=32, n_max=3, volume_samples=256, p_undo=0.2)


def small(out, experiment="base", **changes) -> TrainConfig:
    config = TrainConfig(experiment, out=str(out), epochs=3, samples_per_epoch=12, n_val=8, batch_size=4, max_seq_len=6, synthesis=DATA)
    return replace(config, base=BASE, seed_design=SEED, warmup=2, **changes)


def weights(path):
    with safe_open(path, framework="pt") as file:
        return {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118


@pytest.mark.parametrize("experiment", ["base", "seed"])
def test_a_run_that_was_killed_ends_with_the_same_weights(tmp_path, experiment):
    whole = list(train(small(tmp_path / "whole", experiment)))
    assert [r.step for r in whole] == [3, 6, 9]
    assert whole[-1].stop == "finished"
    killed = train(small(tmp_path / "killed", experiment, save_every=2))
    next(killed)
    killed.close()
    resumed = list(train(small(tmp_path / "killed", experiment, save_every=2, resume=True)))
    assert [r.step for r in resumed] == [6, 9]
    assert [r.val for r in resumed] == [r.val for r in whole[1:]]
    a, b = (load_state(tmp_path / name / "state.pt")["policy"] for name in ("whole", "killed"))
    assert all(torch.equal(a[key], b[key]) for key in a)
    one, other = (weights(tmp_path / name / "best.safetensors") for name in ("whole", "killed"))
    assert all(torch.equal(one[key], other[key]) for key in one)


def test_resuming_another_run_or_none_says_so(tmp_path):
    with pytest.raises(FileNotFoundError, match="nothing to resume"):
        next(train(small(tmp_path, resume=True)))
    next(train(small(tmp_path)))
    with pytest.raises(ValueError, match="another lr"):
        next(train(small(tmp_path, resume=True, lr=0.1)))


def test_training_reads_npz_and_lowers_the_loss(tmp_path):
    list(make_folder(FolderConfig(str(tmp_path / "data"), 12, 8, 0, replace(DATA, p_undo=0.0))))
    roots = {"data_root": str(tmp_path / "data" / "train"), "val_root": str(tmp_path / "data" / "val")}
    reports = list(train(replace(small(tmp_path / "run", lr=5e-3, **roots), epochs=15)))
    assert len(reports) == 15
    assert reports[-1].train["loss"] < 0.8 * reports[0].train["loss"]
    assert reports[0].best
    assert reports[-1].lr < 0.05 * 5e-3 < reports[2].lr


def test_a_time_limit_stops_with_a_whole_state(tmp_path):
    reports = list(train(small(tmp_path, max_minutes=1e-6)))
    assert [(r.step, r.stop) for r in reports] == [(1, "max_minutes")]
    assert list(train(small(tmp_path, resume=True)))[-1].stop == "finished"


def test_a_loss_that_is_not_finite_stops_with_step_and_batch(tmp_path, monkeypatch):
    from imdim.learn.base import BasePolicy

    honest = BasePolicy.losses
    calls = []

    def poisoned(self, batch):
        calls.append(batch)
        losses = honest(self, batch)
        return {**losses, "loss": losses["loss"] * math.nan} if len(calls) == 2 else losses

    monkeypatch.setattr(BasePolicy, "losses", poisoned)
    with pytest.raises(NotFinite, match=r"loss nan.*at step 1; its batch is in .*not_finite_1.pt"):
        list(train(small(tmp_path)))
    saved = load_state(tmp_path / "not_finite_1.pt")
    assert saved["step"] == 1
    assert torch.equal(saved["gt_points"], calls[1].gt_points)


def test_a_checkpoint_comes_back_as_it_was(tmp_path):
    policy = build(small(tmp_path))
    save_policy(tmp_path / "a.safetensors", policy, {"commit": "abc"})
    back, header = load_policy(tmp_path / "a.safetensors")
    assert header["commit"] == "abc"
    assert not back.training
    assert all(torch.equal(value, back.state_dict()[key]) for key, value in policy.state_dict().items())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": "0"}, "checkpoint version 0, this program reads version 1"),
        ({"vocabulary": json.dumps(["ADD_BOX"])}, "vocabulary ADD_BOX, this program's is ADD_BOX ADD_SPHERE"),
        ({"design": "third"}, "design 'third', known are seed, base"),
        ({"format": "other"}, "not a checkpoint of imdim-policy, its format is other"),
        ({"max_seq_len": "9"}, "the weights do not fit the design base"),
    ],
)
def test_foreign_checkpoints_say_what_they_are(tmp_path, change, message):
    path = tmp_path / "a.safetensors"
    save_policy(path, build(small(tmp_path)), {})
    header = {**load_policy(path)[1], **change}
    save_file(weights(path), path, header)
    with pytest.raises(CheckpointError, match=message):
        load_policy(path)


def test_broken_and_missing_checkpoints_are_named(tmp_path):
    (tmp_path / "bad.safetensors").write_bytes(b"no weights")
    with pytest.raises(CheckpointError, match=r"bad.safetensors: not a safetensors file"):
        load_policy(tmp_path / "bad.safetensors")
    with pytest.raises(FileNotFoundError, match="none"):
        load_policy(tmp_path / "none")


def test_a_full_disk_leaves_the_last_checkpoint_whole(tmp_path, monkeypatch):
    path = tmp_path / "a.safetensors"
    save_policy(path, build(small(tmp_path)), {})
    before = path.read_bytes()

    def full(weights, part, header):
        part.write_bytes(b"half of it")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(checkpoint, "save_file", full)
    with pytest.raises(OSError, match="No space"):
        save_policy(path, build(small(tmp_path)), {})
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.safetensors"]


def test_settings_come_from_files_and_arguments(tmp_path):
    from pathlib import Path

    configs = Path(__file__).parents[2] / "configs"
    plain = from_arguments(TrainConfig, [], configs, "pretrain")
    assert (plain.experiment, plain.out, plain.synthesis.p_undo) == ("base", "runs/base", 0.1)
    other = from_arguments(TrainConfig, ["experiment=seed", "synthesis.n_max=4", "batch_size=8"], configs, "pretrain")
    assert (other.out, other.synthesis.n_max, other.synthesis.prefixes, other.batch_size) == ("runs/seed", 4, 2, 8)
    for wrong, message in (
        ("experiment=third", "third"),
        ("batchsize=3", "did you mean batch_size"),
        ("lr=fast", "lr"),
        ("lr", "key=value"),
    ):
        with pytest.raises(ConfigError, match=message):
            from_arguments(TrainConfig, [wrong], configs, "pretrain")
