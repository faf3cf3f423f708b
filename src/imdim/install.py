"""How this copy of the package was installed, for messages that name a command."""

from __future__ import annotations

import json
import shutil
import sys
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote, urlsplit

SOURCE = Path(__file__).parents[2]


def install_command(extra: str) -> str:
    """The shell command that adds an extra to this copy, which may be editable, of a folder, or of a package index (PEP 610)."""
    folder, editable = _find_origin()
    if folder is None:
        return f'{_installer()} "imdim[{extra}]"'
    place = "." if folder == Path.cwd() else str(folder)
    return f'{_installer()} {"-e " if editable else ""}"{place}[{extra}]"'


def _find_origin() -> tuple[Path | None, bool]:
    """The folder that this copy was installed from, None where that is no folder, and whether it is the one that runs."""
    try:
        text = distribution("imdim").read_text("direct_url.json")
    except PackageNotFoundError:  # a source tree that was never installed
        return (SOURCE, True) if (SOURCE / "pyproject.toml").is_file() else (None, False)
    origin = json.loads(text or "{}")
    place = urlsplit(origin.get("url", ""))
    if place.scheme != "file" or "dir_info" not in origin:
        return None, False
    return Path(unquote(place.path)), bool(origin["dir_info"].get("editable"))


def _installer() -> str:
    """`pip install`, by the interpreter's path where the shell's pip is another one's."""
    if find_spec("pip") is None:
        return "uv pip install"
    found = shutil.which("pip")
    near = found is not None and Path(found).absolute().parent == Path(sys.executable).absolute().parent
    return "pip install" if near else f"{sys.executable} -m pip install"
