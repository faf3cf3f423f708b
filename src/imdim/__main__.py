"""``python -m imdim`` is the command ``imdim``, for where its folder is not on the path."""

from imdim.app.cli import run

run()
