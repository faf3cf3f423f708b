"""Whether fixed inputs still give the same programs, byte for byte: what a change that only moves code must keep.

    OMP_NUM_THREADS=1 python scripts/bench/frozen.py [--jobs 2] [--only NAME,NAME] [--write]

Reconstructed are the bundled bracket, its cloud, and planted parts as meshes, as clouds and as noisy clouds, each in a process of its own
with one seed and a budget that cuts nothing, so that the clock decides nothing. Programs are of the six primitives alone, what repeats
read once. The sha256 of
each `program.json` is compared with benchmarks/frozen.json; `--write` writes that file, in a commit that says why digits changed. Exit
status 1: a program changed.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from planting import mesh_of, planted

from imdim.target.scan import parse_condition, scan

ROOT = Path(__file__).parents[2]
FROZEN = ROOT / "benchmarks" / "frozen.json"
EXAMPLES = ROOT / "dataset" / "examples"
BUDGET_S = 1e6
POINTS = 2000  # of a planted cloud: enough for three primitives, quick to search
MESHES = {f"mesh-{n}": n for n in (2, 3, 4, 5, 6)}
CLOUDS = {"cloud-2": (2, "cloud"), "cloud-3": (3, "cloud+normals"), "noisy-1": (1, "noise=1%"), "noisy-2": (2, "noise=0.5%")}
BUNDLED = ("bracket.stl", "bracket_cloud.ply")
NAMES = (*BUNDLED, *MESHES, *CLOUDS)


def main() -> int:
    """Compare or write; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", default="", help=f"some of {', '.join(NAMES)}")
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    names = args.only.split(",") if args.only else NAMES
    if unknown := set(names) - set(NAMES):
        parser.error(f"unknown {', '.join(sorted(unknown))}")
    before = json.loads(FROZEN.read_text()) if FROZEN.is_file() else {}
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(args.jobs) as pool:
        found = dict(zip(names, pool.map(lambda name: _hash(name, Path(folder)), names), strict=True))
    changed = [name for name in names if before.get(name) != found[name]]
    if args.write:
        FROZEN.write_text(json.dumps(before | found, indent=1) + "\n")
    print(f"{len(names) - len(changed)} of {len(names)} programs as before" + (f"; changed: {', '.join(changed)}" if changed else ""))
    return 0 if args.write else int(bool(changed))


def _hash(name: str, folder: Path) -> str:
    """The sha256 of the program of one input."""
    out, start = folder / f"{name}.out", time.perf_counter()
    given = ["-o", str(out), "--budget", str(BUDGET_S), "language=csg", "objective=description"]
    command = [sys.executable, "-m", "imdim.app.cli", "fit", str(_input(name, folder)), *given]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{name}: {done.stderr}")
    text = (out / "program.json").read_bytes()
    print(f"{name}: {done.stdout.splitlines()[0]}, {time.perf_counter() - start:.0f} s", flush=True)
    return hashlib.sha256(text).hexdigest()


def _input(name: str, folder: Path) -> Path:
    """The file to fit, planted in `folder` where it is not a bundled one."""
    if name in BUNDLED:
        return EXAMPLES / name
    if name in MESHES:
        path = folder / f"{name}.stl"
        mesh_of(planted(np.random.default_rng(MESHES[name]), MESHES[name])).export(path)
        return path
    primitives, condition = CLOUDS[name]
    wanted, mesh = parse_condition(condition), mesh_of(planted(np.random.default_rng(primitives), primitives))
    if wanted is None:
        raise ValueError(f"{condition} is no cloud")
    points, normals = scan(mesh, wanted, np.random.default_rng(0))
    keep = np.random.default_rng(0).permutation(len(points))[:POINTS]
    path = folder / f"{name}.npy"
    np.save(path, points[keep] if normals is None else np.hstack([points, normals])[keep])
    return path


if __name__ == "__main__":
    sys.exit(main())
