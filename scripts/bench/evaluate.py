"""Measure a policy on synthetic targets of a fixed seed: ``python scripts/bench/evaluate.py checkpoint=models/imdim-base.safetensors``.

Prints the table of the model card and, with ``out=file.json``, writes every number. Clouds have no normals; IoU is by exact booleans;
the best of a beam is chosen by its distance to the cloud, without the truth. All settings: src/imdim/app/policy_table.py.
"""

from __future__ import annotations

import sys

from imdim.app.policy_table import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], lambda text: print(text, flush=True)))
