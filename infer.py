"""``python infer.py input=part.stl output=out/part [budget_s=60] [seed=0]``: hydra composes the settings, the library does the work."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, epilog="All settings: src/imdim/reconstruction/config.py; overrides: configs/infer.yaml."
    )
    parser.add_argument("overrides", nargs="*", metavar="key=value", help="hydra overrides, e.g. input=part.stl output=out/part seed=1")
    overrides = parser.parse_args().overrides

    from imdim.side_process import leave_cores_to_copies

    leave_cores_to_copies()
    from imdim.app.fit import main
    from imdim.app.orderly import run_in_order
    from imdim.reconstruction.config import from_hydra

    sys.exit(run_in_order(lambda: main(lambda: from_hydra(Path(__file__).parent / "configs", "infer", overrides))))
