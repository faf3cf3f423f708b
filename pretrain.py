"""``python pretrain.py [experiment=base] [max_minutes=60] [resume=true]``: train a policy; settings are key=value."""

from __future__ import annotations

import sys
from pathlib import Path

if __name__ == "__main__":
    if {"-h", "--help"} & set(sys.argv):
        sys.stdout.write(f"{__doc__}\nAll settings: src/imdim/learn/settings.py; overrides: configs/pretrain.yaml and what it names.\n")
        sys.exit(0)

    from imdim.app.learning import run

    sys.exit(run("pretrain", sys.argv[1:], Path(__file__).parent / "configs", lambda text: sys.stdout.write(text + "\n")))
