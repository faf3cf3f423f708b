"""Clouds without programs, and what the whole system finds for them, as targets for training:

``python scripts/make_expert_targets.py out=expert n=1000 [seed=0] [budget_s=20] [synthesis.augment.p_noise=1 ...]``, and then
``python pretrain.py expert_root=expert weights=models/imdim-base.safetensors seed=1``. All settings: src/imdim/app/expert.py.
"""

import sys

from imdim.app.expert import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], lambda text: print(text, flush=True)))
