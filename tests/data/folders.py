"""A data set written in one process, chunk by chunk."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from imdim.data.folder import FolderConfig, chunks, claim, is_there, write_chunk


def make_folder(config: FolderConfig) -> Iterator[tuple[int, int]]:
    """Write what is missing and yield (samples there, samples wanted) after each chunk.

    Raises ValueError when `out` was begun with other settings.
    """
    out = Path(config.out)
    claim(config)
    done, total = 0, config.n_train + config.n_val
    for chunk in chunks(config):
        if not is_there(chunk, out):
            write_chunk(config, chunk, out / chunk.split)
        done += len(chunk.names)
        yield done, total
