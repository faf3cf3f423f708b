"""The peers of `scripts/peers/compare.py`, and one of them on one part.

    python scripts/peers/compare_peers.py PEER TARGET FOLDER [--seed 0]

Writes program.scad or, of a peer whose solid is no program, solid.off, and then peer.json into FOLDER.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

INSTALL = 'pip install "imdim[peers]"'


@dataclass(frozen=True)
class Peer:
    """`function` of the script `module` answers; `package` is the distribution and module that it needs, None for a floor."""

    module: str
    function: str = "solve"
    package: str | None = None


PEERS: Mapping[str, Peer] = {
    "box": Peer("peer_boxes", "bounding"),
    "voxels": Peer("peer_boxes", "cover"),
    "build123d": Peer("peer_build123d", package="build123d"),
    "coacd": Peer("peer_coacd", package="coacd"),
    "pyransac3d": Peer("peer_pyransac3d", package="pyransac3d"),
}


def missing(names: Sequence[str]) -> str:
    """One line that says which packages of these peers are not installed, and what installs them; empty where all are."""
    packages = [package for name in names if name in PEERS and (package := PEERS[name].package) and find_spec(package) is None]
    return f"not installed: {', '.join(packages)}; {INSTALL}, or leave them out of --peers" if packages else ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("peer", choices=list(PEERS))
    parser.add_argument("target", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    if line := missing([args.peer]):
        sys.exit(f"{Path(__file__).name}: {line}")
    try:
        answer(args.peer, args.target, args.folder, args.seed)
    except ValueError as error:
        sys.exit(f"{args.target.name}: {error}")


def answer(name: str, target: Path, folder: Path, seed: int) -> None:
    """Run a peer on a mesh file. Raises ValueError where it finds nothing, and whatever else the peer raises."""
    import trimesh

    mesh = trimesh.load_mesh(target)
    mesh.merge_vertices()
    peer = PEERS[name]
    solve = getattr(importlib.import_module(peer.module), peer.function)
    start = time.monotonic()
    found, parts, note = solve(mesh, seed)
    seconds = time.monotonic() - start
    folder.mkdir(parents=True, exist_ok=True)
    if isinstance(found, trimesh.Trimesh):
        found.export(folder / "solid.off", digits=9)
    else:
        from imdim.export.openscad import to_openscad

        (folder / "program.scad").write_text(to_openscad(found))
    release = version(peer.package) if peer.package else ""
    (folder / "peer.json").write_text(json.dumps({"parts": parts, "note": note, "seconds": seconds, "version": release}))


if __name__ == "__main__":
    main()
