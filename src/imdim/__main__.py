"""``python -m imdim`` is the command ``imdim``, for where its folder is not on the path."""

import sys

from imdim.app.cli import main

sys.exit(main(sys.argv[1:]))
