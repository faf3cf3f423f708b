"""Write a synthetic data set: ``python scripts/make_dataset.py out=dataset n_train=20000 n_val=500 seed=0 [jobs=2]``.

The same settings give the same bytes, however many `jobs`; a run that was stopped goes on where it was. What failed is in
``failures.csv`` and tried again by the same command. All settings: src/imdim/app/batch/dataset.py, src/imdim/data/folder.py.
"""

import sys

from imdim.app.batch.dataset import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
