"""The command of a training run: what it says and writes, and one line for what cannot be."""

from pathlib import Path

import pytest
from tests.data.folders import make_folder

from imdim.app.pretrain import main
from imdim.data.folder import FolderConfig
from imdim.data.synthesize import SynthesisConfig

CONFIGS = Path(__file__).parents[2] / "configs"
DATA = SynthesisConfig(gt_points=64, cur_points=32, n_max=3, volume_samples=256)
SMALL = ["experiment=seed", "samples_per_epoch=8", "n_val=4", "n_measure=2", "batch_size=4", "max_seq_len=6", "warmup=2", "epochs=2"]
SMALL += ["max_minutes=0", "workers=0", "synthesis.gt_points=64", "synthesis.cur_points=32", "synthesis.n_max=3", "synthesis.prefixes=1"]
SMALL += ["synthesis.volume_samples=256", "seed_design.d_model=16", "seed_design.layers=1", "seed_design.heads=2", "seed_design.hidden=16"]


def test_a_run_reports_logs_and_saves(tmp_path):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    said: list[str] = []
    assert main([*SMALL, f"out={tmp_path}"], CONFIGS, said.append) == 0
    assert [line.split(":")[0] for line in said] == ["step 2", "step 4"]
    assert "iou_median" in said[-1]
    assert said[-1].endswith("stopped: finished")
    assert {"best.safetensors", "state.pt"} <= {p.name for p in tmp_path.iterdir()}
    events = EventAccumulator(str(tmp_path)).Reload()
    wanted = {"train/loss", "val/loss", "val/token_accuracy", "val/iou_median", "run/lr", "run/samples_per_second", "run/data_share"}
    assert wanted <= set(events.Tags()["scalars"])
    assert [e.step for e in events.Images("target and written")] == [16]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["device=gpu7"], "setting device: cannot use 'gpu7'"),
        (["device=cuda:99"], "setting device: cannot use 'cuda:99'"),
        (["resume=true"], "nothing to resume"),
        (["data_root=nowhere"], "nowhere holds no .npz samples"),
        (["shards=3"], "cannot share a batch of 4"),
        (["precision=half"], "unknown precision"),
        (["epocs=3"], "did you mean epochs"),
        (["synthesis.n_max=40"], "programs have 1 to 12 primitives"),
    ],
)
def test_what_cannot_be_is_one_line_and_status_2(tmp_path, capsys, arguments, message):
    assert main([*SMALL, f"out={tmp_path / 'run'}", *arguments], CONFIGS, print) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_a_corrupt_sample_is_one_line_that_names_it(tmp_path, capsys):
    list(make_folder(FolderConfig(str(tmp_path), 8, 4, 0, DATA)))
    (tmp_path / "train" / "sample_00003.npz").write_bytes(b"no archive")
    arguments = [f"out={tmp_path / 'run'}", f"data_root={tmp_path / 'train'}", f"val_root={tmp_path / 'val'}", "workers=1"]
    assert main([*SMALL, *arguments], CONFIGS, print) == 2
    error = capsys.readouterr().err
    assert "sample_00003.npz: not an npz archive" in error
    assert error.count("\n") == 1
