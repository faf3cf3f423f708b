"""The live lab from a checkout: ``python scripts/lab.py [part.stl]``. The same as ``imdim lab``."""

from __future__ import annotations

import sys

from imdim.app.lab.server import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
