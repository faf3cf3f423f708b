"""Take the changes of design back one by one and train each for the same time.

    python scripts/bench/ablate.py minutes=5 [only=[pointing]]

Prints the table of the model card; checkpoints and every number are in runs/ablation. All settings: src/imdim/app/ablation.py.
"""

from __future__ import annotations

import sys
from pathlib import Path

from imdim.app.ablation import main

if __name__ == "__main__":
    if {"-h", "--help"} & set(sys.argv):
        print(__doc__)
        sys.exit(0)
    sys.exit(main(sys.argv[1:], Path(__file__).parents[2] / "configs", lambda text: print(text, flush=True)))
