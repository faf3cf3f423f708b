"""A folder of samples from a seed: ``train/`` and ``val/`` in the project's npz layout, resumable, the same bytes for the same settings."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
import torch

from imdim.data.npz import split_samples, write_sample
from imdim.data.synthesize import SynthesisConfig, synthesize
from imdim.whole_file import write_text_whole

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


@dataclass(frozen=True)
class Chunk:
    """Samples of one split that one generator draws: number `index` of its stream, with the file `names` wanted of it."""

    split: str
    index: int
    names: tuple[str, ...]


def chunk_generator(seed: int, stream: int, index: int, device: torch.device | str = "cpu") -> torch.Generator:
    """The generator of chunk (or training step) `index` of a stream: a function of its arguments alone, so any point can be resumed."""
    words = np.random.SeedSequence((seed, stream, index)).generate_state(2, np.uint32)
    return torch.Generator(device).manual_seed(int(words[0]) << 31 | int(words[1]) >> 1)


def chunks(config: FolderConfig) -> Iterator[Chunk]:
    """All chunks of a folder, in order."""
    for split in SPLITS:
        wanted = getattr(config, f"n_{split}")
        for first in range(0, wanted, CHUNK):
            numbers = range(first, min(first + CHUNK, wanted))
            yield Chunk(split, first // CHUNK, tuple(f"sample_{i:05d}.npz" for i in numbers))


def is_there(chunk: Chunk, out: Path) -> bool:
    """Whether all files of a chunk are in the folder `out`."""
    return all((out / chunk.split / name).exists() for name in chunk.names)


def write_chunk(config: FolderConfig, chunk: Chunk, folder: Path) -> None:
    """Write the samples of a chunk into `folder`, each whole or not at all."""
    # a file has no word for a primitive that takes another one's place
    synthesis = replace(config.synthesis, p_replace=0.0)
    samples = synthesize(CHUNK, synthesis, chunk_generator(config.seed, SPLITS.index(chunk.split), chunk.index))
    for name, sample in zip(chunk.names, split_samples(samples), strict=False):
        write_sample(folder / name, sample)


def claim(config: FolderConfig) -> None:
    """Make the folders and note the settings that decide the bytes, or compare with those noted: ValueError where they are others."""
    out = Path(config.out)
    note = out / "dataset.json"
    settings = json.dumps({"seed": config.seed, "chunk": CHUNK, "synthesis": asdict(config.synthesis)}, indent=1, sort_keys=True)
    if note.exists() and note.read_text() != settings:
        raise ValueError(f"{note} is of a data set with other settings; choose another folder")
    for split in SPLITS:
        (out / split).mkdir(parents=True, exist_ok=True)
    write_text_whole(note, settings)
