"""The one folder whose files an agent may read and write."""

from __future__ import annotations

from itertools import islice
from pathlib import Path, PureWindowsPath

from imdim.reconstruction.config import ConfigError, one_line
from imdim.target.readers import FORMATS

MOST_LISTED = 50
MOST_SEEN = 20_000  # of a folder, which may be a person's whole home


class Workplace:
    """See the module. All paths are given and said relative to `root`."""

    def __init__(self, root: Path) -> None:
        """Raises ConfigError unless `root` is a folder."""
        if not root.is_dir():
            raise ConfigError(f"{root}: is no folder")
        self.root = root.resolve()

    def resolve(self, path: str) -> Path:
        """The place of a relative path inside the folder, which need not exist. Raises ConfigError for any other."""
        shown = one_line(path)
        if not path or Path(path).is_absolute() or PureWindowsPath(path).drive or PureWindowsPath(path).root:
            raise ConfigError(f"{shown or 'the path'}: give a path relative to the folder of the server")
        try:
            place = (self.root / path).resolve()
        except (OSError, ValueError, RuntimeError) as error:  # a byte of 0, a link to itself
            raise ConfigError(f"{shown}: is no path") from error
        if not place.is_relative_to(self.root):
            raise ConfigError(f"{shown}: leads out of the folder of the server")
        return place

    def read_path(self, path: str) -> Path:
        """The place of a file or folder that is there, no part of which is a link out. Raises ConfigError."""
        place = self.resolve(path)
        if not place.exists():
            raise ConfigError(f"{one_line(path)}: there is no such file")
        for inside in place.iterdir() if place.is_dir() else place.parent.glob("program*"):
            if inside.is_symlink():
                self.resolve(str(inside.relative_to(self.root)))
        return place

    def write_path(self, path: str) -> Path:
        """The place of a folder for results, not the root itself. Raises ConfigError."""
        place = self.resolve(path)
        if place == self.root:
            raise ConfigError(f"{one_line(path)}: give a folder inside the server's")
        return place

    def shorten(self, message: str) -> str:
        """A message without the place of the folder."""
        return message.replace(f"{self.root}/", "").replace(str(self.root), ".")

    def list_parts(self) -> list[str]:
        """Meshes, clouds and results folders, hidden ones left out, at most MOST_LISTED of the first MOST_SEEN files and folders."""
        seen = islice(self.root.rglob("*"), MOST_SEEN)
        found = sorted(path for path in seen if not any(p.startswith(".") for p in path.relative_to(self.root).parts))
        results = [path.parent for path in found if path.name == "program.json"]
        parts = [p for p in found if p.suffix.lower() in FORMATS and p.is_file() and p.parent not in results]
        return [str(p.relative_to(self.root)) for p in sorted({*parts, *results})][:MOST_LISTED]
