"""``python reinforce.py checkpoint=FILE [max_minutes=30] [resume=true]``: fine-tune a policy by the reward of the programs it writes."""

from __future__ import annotations

import sys
from pathlib import Path

if __name__ == "__main__":
    if {"-h", "--help"} & set(sys.argv):
        sys.stdout.write(f"{__doc__}\nAll settings: src/imdim/learn/reinforce.py; overrides: configs/reinforce.yaml and what it names.\n")
        sys.exit(0)

    from imdim.app.learning import run

    sys.exit(run("reinforce", sys.argv[1:], Path(__file__).parent / "configs", lambda text: sys.stdout.write(text + "\n")))
