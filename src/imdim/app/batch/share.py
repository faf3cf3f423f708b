"""``python -m imdim.app.batch.share SHARE.json -o FOLDER``: the samples of some chunks of a data set, as files of one folder."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import torch

from imdim.data.folder import Chunk, FolderConfig, write_chunk
from imdim.reconstruction.config import ConfigError, merge


def main(arguments: Sequence[str]) -> int:
    """Draw one share; the exit status."""
    source, _, out = arguments
    torch.set_num_threads(1)
    try:
        share = json.loads(Path(source).read_text(encoding="utf-8"))
        config = merge(FolderConfig, share["config"])
        Path(out).mkdir(parents=True, exist_ok=True)
        for split, index, names in share["chunks"]:
            write_chunk(config, Chunk(split, index, tuple(names)), Path(out))
    except (ConfigError, ValueError, OSError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
