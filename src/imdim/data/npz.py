"""Samples as npz files (`gt_points`, `cur_points`, `gt_tokens`, `gt_params`) and the data set that reads a folder of them.

Source: the project's design, section 6. Files hold one sequence without padding; a batch pads tokens with PAD and parameters with zeros.
"""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from imdim.data.solids import PAD, VOCABULARY, WIDE_COUNT
from imdim.data.synthesize import TrainingSamples
from imdim.program.state import END, PARAM_COUNT, Token
from imdim.target.archives import ArchiveError, open_archive, read_member

FIELDS = ("gt_points", "cur_points", "gt_tokens", "gt_params")
_EPOCH = (1980, 1, 1, 0, 0, 0)


class SampleError(ValueError):
    """A file is no sample; the message names the file and the field."""


class NPZCADDataset(Dataset[dict[str, Tensor]]):
    """The samples ``*.npz`` of a folder in the order of their names, each checked when it is read.

    Items: `gt_points` float32 [n, 3], `cur_points` float32 [m, 3], `gt_tokens` int64 [t], `gt_params` float32 [t, 10], or [t, WIDE_COUNT]
    where the program has outlines or intersections. `max_seq_len` refuses longer sequences. Raises SampleError for a broken file and
    FileNotFoundError for a folder without samples.
    """

    def __init__(self, root: str | Path, max_seq_len: int | None = None) -> None:
        self.paths = sorted(Path(root).glob("*.npz"))
        self.max_seq_len = max_seq_len
        if not self.paths:
            raise FileNotFoundError(f"{root} holds no .npz samples; scripts/make_dataset.py makes them")

    def __len__(self) -> int:
        return len(self.paths)

    def __getitem__(self, index: int) -> dict[str, Tensor]:
        sample = read_sample(self.paths[index])
        if self.max_seq_len is not None and len(sample["gt_tokens"]) > self.max_seq_len:
            raise SampleError(f"{self.paths[index]}: gt_tokens has {len(sample['gt_tokens'])} steps, max_seq_len is {self.max_seq_len}")
        return {name: torch.from_numpy(array) for name, array in sample.items()}


def collate(items: list[dict[str, Tensor]]) -> dict[str, Tensor]:
    """Items as one batch: sequences padded to the longest, clouds of differing sizes cut to the smallest (order in a cloud is random)."""
    batch = {
        "gt_tokens": torch.nn.utils.rnn.pad_sequence([i["gt_tokens"] for i in items], batch_first=True, padding_value=PAD),
        "gt_params": torch.nn.utils.rnn.pad_sequence([_widen(i["gt_params"]) for i in items], batch_first=True),
    }
    for name in ("gt_points", "cur_points"):
        least = min(len(i[name]) for i in items)
        batch[name] = torch.stack([i[name][:least] for i in items])
    return batch


def _widen(params: Tensor) -> Tensor:
    """Numbers [t, WIDE_COUNT]: what has ten has no outlines and no intersections."""
    return torch.nn.functional.pad(params, (0, WIDE_COUNT - params.shape[1]))


def read_sample(path: Path) -> dict[str, np.ndarray]:
    """The four arrays of one file. Raises SampleError that names the file and the field, OSError when it cannot be opened."""
    try:
        with path.open("rb") as file, open_archive(file) as archive:
            arrays = {name: _field(path, archive, name) for name in FIELDS}
    except ArchiveError as error:
        raise SampleError(f"{path}: not an npz archive: {error}") from error
    _check(path, arrays)
    return {name: np.ascontiguousarray(array, np.int64 if name == "gt_tokens" else np.float32) for name, array in arrays.items()}


def write_sample(path: Path, sample: Mapping[str, np.ndarray]) -> None:
    """Write one checked sample, whole or not at all, the same bytes for the same arrays."""
    arrays = {name: np.ascontiguousarray(sample[name]) for name in FIELDS}
    _check(path, arrays)
    part = path.with_name(path.name + ".part")
    with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, array in arrays.items():
            # np.savez would write the time of day into the archive
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, array, allow_pickle=False)
            entry = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, buffer.getvalue())
    os.replace(part, path)


def split_samples(samples: TrainingSamples) -> list[dict[str, np.ndarray]]:
    """One mapping of arrays per row, without padding; the cloud of an empty prefix has no points."""
    out = []
    for gt, current, tokens, params, steps in zip(*(t.cpu() for t in samples[:5]), strict=True):
        length = int((tokens != PAD).sum())
        cur = current if steps > 0 and bool(current.any()) else current[:0]
        numbers = params[:length].float()
        plain = not bool(numbers[:, PARAM_COUNT:].any())
        arrays = (gt.float(), cur.float(), tokens[:length].short(), numbers[:, :PARAM_COUNT] if plain else numbers)
        out.append({name: a.numpy() for name, a in zip(FIELDS, arrays, strict=True)})
    return out


def _field(path: Path, archive: zipfile.ZipFile, name: str) -> np.ndarray:
    info = next((info for info in archive.infolist() if info.filename == f"{name}.npy"), None)
    if info is None:
        raise SampleError(f"{path}: field {name} is missing")
    try:
        return read_member(archive, info)
    except ArchiveError as error:
        raise SampleError(f"{path}: field {name} cannot be read: {error}") from error


def _check(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    tokens = arrays["gt_tokens"]
    if tokens.ndim != 1 or not len(tokens) or not np.issubdtype(tokens.dtype, np.integer):
        raise SampleError(f"{path}: field gt_tokens needs integers [t], t > 0, got {tokens.dtype} {list(tokens.shape)}")
    wide = arrays["gt_params"].ndim == 2 and arrays["gt_params"].shape[1] == WIDE_COUNT
    shapes = {"gt_points": (None, 3), "cur_points": (None, 3), "gt_params": (len(tokens), WIDE_COUNT if wide else PARAM_COUNT)}
    for name, shape in shapes.items():
        array = arrays[name]
        fits = array.ndim == 2 and all(s is None or s == d for s, d in zip(shape, array.shape, strict=True))
        if not fits or not np.issubdtype(array.dtype, np.floating):
            raise SampleError(
                f"{path}: field {name} needs floats {['any' if s is None else s for s in shape]}, got {array.dtype} {list(array.shape)}"
            )
        if not np.isfinite(array).all():
            raise SampleError(f"{path}: field {name} holds {int((~np.isfinite(array)).sum())} values that are not finite")
    if not len(arrays["gt_points"]):
        raise SampleError(f"{path}: field gt_points is empty")
    known = len(VOCABULARY if wide else Token)
    if tokens.min() < 0 or tokens.max() >= known:
        raise SampleError(f"{path}: field gt_tokens holds ids {tokens.min()} to {tokens.max()}, known are 0 to {known - 1}")
    if (tokens[:-1] == END).any():
        raise SampleError(f"{path}: field gt_tokens has steps after END: {tokens.tolist()}")
