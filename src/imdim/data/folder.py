"""A folder of samples from a seed: ``train/`` and ``val/`` in the project's npz layout, resumable, the same bytes for the same settings."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import torch

from imdim.data.npz import split_samples, write_sample
from imdim.data.synthesize import SynthesisConfig, synthesize

CHUNK = 64  # samples from one generator; part of what a seed means
SPLITS = ("train", "val")


@dataclass
class FolderConfig:
    """`out` gets `n_train` and `n_val` samples of `synthesis`; `seed` fixes them all."""

    out: str = "dataset"
    n_train: int = 1000
    n_val: int = 100
    seed: int = 0
    synthesis: SynthesisConfig = field(default_factory=SynthesisConfig)


def chunk_generator(seed: int, stream: int, index: int, device: torch.device | str = "cpu") -> torch.Generator:
    """The generator of chunk (or training step) `index` of a stream: a function of its arguments alone, so any point can be resumed."""
    words = np.random.SeedSequence((seed, stream, index)).generate_state(2, np.uint32)
    return torch.Generator(device).manual_seed(int(words[0]) << 31 | int(words[1]) >> 1)


def make_folder(config: FolderConfig) -> Iterator[tuple[int, int]]:
    """Write what is missing and yield (samples there, samples wanted) after each chunk.

    Files appear whole or not at all. Raises ValueError when `out` was begun with other settings.
    """
    out = Path(config.out)
    _claim(out, config)
    wanted = {split: getattr(config, f"n_{split}") for split in SPLITS}
    done = 0
    for stream, split in enumerate(SPLITS):
        (out / split).mkdir(parents=True, exist_ok=True)
        for chunk in range(-(-wanted[split] // CHUNK)):
            numbers = range(chunk * CHUNK, min((chunk + 1) * CHUNK, wanted[split]))
            paths = [out / split / f"sample_{i:05d}.npz" for i in numbers]
            if not all(p.exists() for p in paths):
                samples = synthesize(CHUNK, config.synthesis, chunk_generator(config.seed, stream, chunk))
                for path, sample in zip(paths, split_samples(samples), strict=False):
                    write_sample(path, sample)
            done += len(paths)
            yield done, sum(wanted.values())


def _claim(out: Path, config: FolderConfig) -> None:
    """Note the settings that decide the bytes, or compare with those noted."""
    note = out / "dataset.json"
    settings = json.dumps({"seed": config.seed, "chunk": CHUNK, "synthesis": asdict(config.synthesis)}, indent=1, sort_keys=True)
    if note.exists() and note.read_text() != settings:
        raise ValueError(f"{note} is of a data set with other settings; choose another folder")
    out.mkdir(parents=True, exist_ok=True)
    part = note.with_suffix(".part")
    part.write_text(settings)
    os.replace(part, note)
