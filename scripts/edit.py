"""Change named numbers of a delivered program: ``python scripts/edit.py out/program.json --set hole_radius=3.2 -o new``.

``--list`` prints the names. The same as ``imdim edit``.
"""

from __future__ import annotations

import sys

from imdim.app.edit import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], "scripts/edit.py"))
