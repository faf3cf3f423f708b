"""Write a synthetic data set: ``python scripts/make_dataset.py out=dataset n_train=20000 n_val=500 seed=0``.

The same settings give the same bytes; a run that was stopped goes on where it was. All settings: src/imdim/data/folder.py.
"""

from __future__ import annotations

import sys
import time

import torch

from imdim.app.arguments import from_arguments
from imdim.config import ConfigError
from imdim.data.folder import FolderConfig, make_folder


def main(arguments: list[str]) -> int:
    torch.set_num_threads(1)
    start = time.monotonic()
    done = total = 0
    try:
        for done, total in make_folder(from_arguments(FolderConfig, arguments)):
            print(f"\r{done}/{total} samples, {done / (time.monotonic() - start):.0f} per second", end="", flush=True)
    except (ConfigError, ValueError, OSError) as error:
        print(f"make_dataset: {error}", file=sys.stderr)
        return 2
    print()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
