"""Files of samples: round trips, broken files by name and field, folders that are the same bytes however they were made."""

import zipfile
from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.data.folders import make_folder

from imdim.data.augment import AugmentConfig, augment
from imdim.data.families import PLAIN
from imdim.data.folder import FolderConfig
from imdim.data.npz import NPZCADDataset, SampleError, collate, read_sample, split_samples, write_sample
from imdim.data.solids import PAD, from_sequences
from imdim.data.synthesize import SynthesisConfig, synthesize
from imdim.program.state import END

SMALL = SynthesisConfig(gt_points=64, cur_points=32, volume_samples=512)


def small_folder(path, n_train=70):
    return FolderConfig(str(path), n_train, 3, 7, SMALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("data")
    assert list(make_folder(small_folder(path)))[-1] == (73, 73)
    return path


def test_a_sample_comes_back_as_it_was_drawn(tmp_path):
    samples = synthesize(4, replace(SMALL, families=PLAIN), torch.Generator().manual_seed(0))
    for row, sample in enumerate(split_samples(samples)):
        write_sample(tmp_path / "a.npz", sample)
        back = read_sample(tmp_path / "a.npz")
        length = len(back["gt_tokens"])
        assert back["gt_tokens"][-1] == END
        assert (back["gt_tokens"] == samples.gt_tokens[row, :length].numpy()).all()
        assert back["gt_params"].shape == (length, 10)
        assert (back["gt_params"] == samples.gt_params[row, :length, :10].numpy()).all()
        assert (back["gt_points"] == samples.gt_points[row].numpy()).all()
        with np.load(tmp_path / "a.npz") as plain:
            assert sorted(plain.files) == ["cur_points", "gt_params", "gt_points", "gt_tokens"]


def test_outlines_and_intersections_come_back_in_wider_rows(tmp_path):
    """A file has fifteen numbers a step only where the program needs them; one batch holds both."""
    samples = synthesize(24, replace(SMALL, families=("plate", "profile", "ring", "common"), n_max=4), torch.Generator().manual_seed(0))
    for row, sample in enumerate(split_samples(samples)):
        write_sample(tmp_path / f"{row:02}.npz", sample)
        back = read_sample(tmp_path / f"{row:02}.npz")
        length, numbers = len(back["gt_tokens"]), samples.gt_params[row]
        assert back["gt_params"].shape == (length, 15 if numbers[:, 10:].any() else 10)
        assert (back["gt_params"] == numbers[:length, : back["gt_params"].shape[1]].numpy()).all()
        assert (back["gt_tokens"] == samples.gt_tokens[row, :length].numpy()).all()
    data = NPZCADDataset(tmp_path)
    assert {data[i]["gt_params"].shape[1] for i in range(24)} == {10, 15}
    batch = collate([data[i] for i in range(24)])
    assert torch.equal(batch["gt_params"], samples.gt_params[:, : batch["gt_params"].shape[1]])
    one, other = (from_sequences(t, p) for t, p in ((batch["gt_tokens"], batch["gt_params"]), (samples.gt_tokens, samples.gt_params)))
    assert torch.equal(one.forms, other.forms)
    assert torch.equal(one.common, other.common)
    assert one.drawn.any()
    assert one.common.any()


@pytest.mark.parametrize(
    ("token", "columns", "message"),
    [
        (7, 10, "field gt_tokens holds ids 4 to 7, known are 0 to 6"),
        (9, 15, "field gt_tokens holds ids 4 to 9, known are 0 to 8"),
        (0, 14, r"field gt_params needs floats \[2, 10\], got float32 \[2, 14\]"),
    ],
)
def test_an_outline_needs_its_form_in_the_file(folder, tmp_path, token, columns, message):
    arrays = dict(np.load(folder / "train" / "sample_00000.npz"))
    np.savez(tmp_path / "bad.npz", **{**arrays, "gt_tokens": np.array([token, 4]), "gt_params": np.zeros((2, columns), np.float32)})
    with pytest.raises(SampleError, match="bad.npz: " + message):
        read_sample(tmp_path / "bad.npz")


def test_the_same_seed_writes_the_same_bytes_also_after_an_interruption(folder, tmp_path):
    run = make_folder(small_folder(tmp_path))
    next(run)
    run.close()  # stopped after the first chunk
    (tmp_path / "train" / "sample_00005.npz").unlink()
    list(make_folder(small_folder(tmp_path)))
    for path in sorted(folder.rglob("*.npz")):
        assert path.read_bytes() == (tmp_path / path.relative_to(folder)).read_bytes()
    assert not list(tmp_path.rglob("*.part*"))


def test_another_seed_is_refused_in_the_same_folder(folder):
    with pytest.raises(ValueError, match="other settings"):
        next(make_folder(FolderConfig(str(folder), 70, 3, 8, SMALL)))


def test_training_and_validation_share_no_sample(folder):
    first = (folder / "train" / "sample_00000.npz").read_bytes()
    assert all(p.read_bytes() != first for p in (folder / "val").glob("*.npz"))


def test_batches_pad_tokens_and_parameters(folder):
    data = NPZCADDataset(folder / "train")
    batch = collate([data[i] for i in range(8)])
    assert batch["gt_points"].shape == (8, 64, 3)
    padded = batch["gt_tokens"] == PAD
    assert padded.any()
    assert (batch["gt_params"][padded] == 0).all()
    with pytest.raises(SampleError, match=r"sample_000\d\d.npz: gt_tokens has \d+ steps, max_seq_len is 1"):
        NPZCADDataset(folder / "train", max_seq_len=1)[0]
    with pytest.raises(FileNotFoundError, match="make_dataset"):
        NPZCADDataset(folder)


@pytest.mark.parametrize(
    ("field", "array", "message"),
    [
        ("gt_points", np.full((5, 3), np.nan, np.float32), "field gt_points holds 15 values that are not finite"),
        ("gt_points", np.zeros((0, 3), np.float32), "field gt_points is empty"),
        ("cur_points", np.zeros((5, 2), np.float32), "field cur_points needs floats"),
        ("gt_tokens", np.array([0, 9]), "field gt_tokens holds ids 0 to 9"),
        ("gt_tokens", np.array([4, 0]), "field gt_tokens has steps after END"),
        ("gt_tokens", np.array([0.5]), "field gt_tokens needs integers"),
        ("gt_params", np.zeros((1, 10), np.float32), "field gt_params needs floats"),
        ("gt_params", np.array([["a"]]), "field gt_params needs floats"),
    ],
)
def test_a_wrong_array_names_the_file_and_the_field(folder, tmp_path, field, array, message):
    arrays = dict(np.load(folder / "train" / "sample_00000.npz"))
    arrays["gt_tokens"], arrays["gt_params"] = np.array([0, 4]), np.zeros((2, 10), np.float32)
    np.savez(tmp_path / "bad.npz", **{**arrays, field: array})
    with pytest.raises(SampleError, match="bad.npz: " + message):
        read_sample(tmp_path / "bad.npz")


def test_damaged_files_name_the_file_and_the_field(folder, tmp_path):
    source, bad = folder / "train" / "sample_00000.npz", tmp_path / "bad.npz"
    whole = source.read_bytes()
    with zipfile.ZipFile(source) as archive:
        start = archive.getinfo("gt_params.npy").header_offset + 60
    bad.write_bytes(whole[:start] + bytes(b ^ 0xFF for b in whole[start : start + 8]) + whole[start + 8 :])
    with pytest.raises(SampleError, match=r"bad\.npz: field gt_params cannot be read"):
        read_sample(bad)
    bad.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(SampleError, match=r"bad\.npz: not an npz archive"):
        read_sample(bad)
    np.savez(bad, gt_points=np.zeros((3, 3)))
    with pytest.raises(SampleError, match=r"bad\.npz: field cur_points is missing"):
        read_sample(bad)


def test_augmentations_do_what_their_names_say():
    points = torch.rand(3, 4000, 3, generator=torch.Generator().manual_seed(0)) - 0.5
    generator = torch.Generator().manual_seed(1)
    assert torch.equal(augment(points, AugmentConfig(), generator), points)
    noisy = augment(points, AugmentConfig(p_noise=1.0, noise=0.02), generator) - points
    assert 0 < float(noisy.std()) <= 0.02
    stray = augment(points, AugmentConfig(p_outliers=1.0, outliers=0.1), generator)
    assert 0 < float((stray != points).any(-1).float().mean()) <= 0.1
    cut = augment(points, AugmentConfig(p_missing=1.0, missing=0.5), generator)
    assert all(len(row.unique(dim=0)) < 3000 for row in cut)
    lean = augment(points, AugmentConfig(p_uneven=1.0), generator)
    # the same points, but their mean moves away from the sparse end
    assert float(lean.mean(1).norm(dim=-1).max()) > 0.03
