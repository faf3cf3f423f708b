"""Write a lock: the versions of constraints.txt with the sha256 of the archives that pip picks for this machine, so that a later
installation, here or on machines like it, gets these bytes and no others.

    python scripts/lock.py [--extras step,lab] [--out requirements.lock]
    pip install --require-hashes --no-deps -r requirements.lock && pip install --no-deps .

pip resolves and downloads as it would to install; nothing is installed. The lock names no index, so that it serves with any mirror of one.
It is of one platform and one version of Python, which is why the repository has none. Exit status 2 where pip finds no answer.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PLACE = "(see scripts/lock.py)"


def main(argv: Sequence[str] | None = None) -> int:
    """Write the lock; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--extras", default="step", help="joined by commas (default step, as the README installs it)")
    parser.add_argument("--out", type=Path, default=Path("requirements.lock"))
    args = parser.parse_args(argv)
    wanted = f"{ROOT}[{args.extras}]" if args.extras else str(ROOT)
    try:
        lines = lock_lines(resolve(["-c", str(ROOT / "constraints.txt"), wanted]))
    except (subprocess.CalledProcessError, ValueError) as error:
        sys.stderr.write(f"lock: {error}\n")
        return 2
    head = f"# imdim[{args.extras}] on {sys.platform}, Python {sys.version_info.major}.{sys.version_info.minor} {PLACE}"
    args.out.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    print(f"{len(lines)} packages in {args.out}")
    return 0


def resolve(arguments: Sequence[str]) -> Mapping[str, Any]:
    """pip's report of what it would install into an empty environment; raises CalledProcessError where it finds no answer."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        options = ["--dry-run", "--ignore-installed", "--quiet", "--disable-pip-version-check", "--report", str(report)]
        subprocess.run([sys.executable, "-m", "pip", "install", *options, *arguments], check=True)
        return json.loads(report.read_text(encoding="utf-8"))


def lock_lines(report: Mapping[str, Any]) -> list[str]:
    """A line for each package by name, with its version and hash; raises ValueError for an archive without one. Folders, as that of this
    repository, are no archives."""
    lines = []
    for item in report["install"]:
        if "dir_info" in item["download_info"]:
            continue
        name, version = item["metadata"]["name"], item["metadata"]["version"]
        digest = item["download_info"].get("archive_info", {}).get("hashes", {}).get("sha256")
        if digest is None:
            raise ValueError(f"{name} {version}: pip knows no sha256 of it")
        lines.append(f"{name}=={version} --hash=sha256:{digest}")
    return sorted(lines, key=str.lower)


if __name__ == "__main__":
    raise SystemExit(main())
