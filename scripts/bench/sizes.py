"""Start-up, and time and memory against the size of the input, through the real readers and the real command; plots of their growth.

    OMP_NUM_THREADS=1 python scripts/bench/sizes.py [start] [read] [fit] [plots] [--out out/sizes] [--repeat 10] [--plots benchmarks]

`start` is `imdim --help`, and `infer.py` until its first line of progress. `read` loads clouds of up to 5 million points and meshes of up
to 2 million faces in every format, each in a process of its own. `fit` reconstructs the same part from more and more points and faces with
a small budget, of the six primitives alone. `plots` draws what `--out` holds of both, and needs matplotlib (`pip install "imdim[plots]"`).
Seconds are those of the processor, of the process and its children, with those of the clock beside them: others may run on the same cores.
Memory is the most that resided. Without names the first three are done.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import trimesh

from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.tree import Combine, Primitive
from imdim.target.target import sample_surface

ROOT = Path(__file__).parents[2]
PART = Combine("difference", Primitive("box", (40.0, 30.0, 20.0)), Primitive("cylinder", (8.0, 30.0)))
POINTS, FACES = (5_000, 50_000, 500_000, 5_000_000), (2_000, 20_000, 200_000, 2_000_000)
CLOUDS, MESHES = ("ply", "npy", "pcd", "xyz"), ("stl", "ply", "off", "obj", "glb", "3mf")
FITTED = {"cloud": "ply", "mesh": "stl"}
BUDGET_S = 10.0
IMPORTS = "import sys; from imdim.target.target import load_target"
READ = f"{IMPORTS}; load_target(sys.argv[1])"


@dataclass(frozen=True)
class Cost:
    """Of one process and its children: seconds of the processor and of the clock, MiB resident at most, and how it ended."""

    cpu_s: float
    wall_s: float
    mib: float
    status: int


@dataclass(frozen=True)
class Row:
    """`what` is done to a file of `size` points or faces."""

    what: str
    kind: str
    format: str
    size: int
    cost: Cost


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", metavar="start|read|fit|plots")
    parser.add_argument("--out", type=Path, default=Path("out/sizes"))
    parser.add_argument("--repeat", type=int, default=10)
    parser.add_argument("--most", type=float, default=float("inf"), help="leave out what is larger")
    parser.add_argument("--plots", type=Path, default=ROOT / "benchmarks")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    known = {"start": start, "read": read, "fit": fit, "plots": plots}
    for what in args.what or ("start", "read", "fit"):
        if what not in known:
            parser.error(f"{what} is none of {', '.join(known)}")
        known[what](args)
    return 0


def start(args: argparse.Namespace) -> None:
    commands = {
        "imdim --help": ([sys.executable, "-m", "imdim.app.cli", "--help"], False),
        "infer.py, first line of progress": (
            [sys.executable, "infer.py", "input=dataset/examples/bracket.stl", f"output={args.out / 'start'}"],
            True,
        ),
    }
    for name, (command, first_line) in commands.items():
        runs = [until_line(command) if first_line else cost(command) for _ in range(args.repeat + 1)][1:]
        wall, cpu = [run.wall_s for run in runs], statistics.median(run.cpu_s for run in runs)
        print(f"{name}: {statistics.median(wall):.2f} s of the clock (least {min(wall):.2f}), {cpu:.2f} s of the processor")


def cost(command: list[str], log: Path | None = None) -> Cost:
    """What a command takes."""
    begun, mib = time.monotonic(), 0.0
    with open(log or os.devnull, "wb") as out:
        process = subprocess.Popen(command, stdout=out, stderr=out, cwd=ROOT)
    while True:
        ended, status, usage = os.wait4(process.pid, os.WNOHANG)
        if ended:
            break
        mib = max(mib, peak_mib(process.pid))
        time.sleep(0.01)
    process.returncode = os.waitstatus_to_exitcode(status)
    return Cost(usage.ru_utime + usage.ru_stime, time.monotonic() - begun, mib, process.returncode)


def peak_mib(pid: int) -> float:
    """The most that has resided of a process's own memory; what `wait4` tells begins with that of the parent."""
    found = re.search(r"VmHWM:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
    return int(found[1]) / 1024 if found else 0.0


def until_line(command: list[str]) -> Cost:
    """What a command takes until it says something; it is ended then."""
    begun = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=ROOT)
    assert process.stderr is not None
    process.stderr.readline()
    wall = time.monotonic() - begun
    process.kill()
    _, _, usage = os.wait4(process.pid, 0)
    process.returncode = 0
    process.stderr.close()
    return Cost(usage.ru_utime + usage.ru_stime, wall, 0.0, 0)


def read(args: argparse.Namespace) -> None:
    """Every format at its largest, and the growth of those that are fitted."""
    base = cost([sys.executable, "-c", IMPORTS])
    print(f"the imports alone: {base.cpu_s:.1f} s, {base.mib:.0f} MiB")
    for kind, sizes, formats in (("cloud", POINTS, CLOUDS), ("mesh", FACES, MESHES)):
        for size in sizes:
            for form in formats if size == sizes[-1] else (FITTED[kind],):
                if size <= args.most:
                    path = made(args.out, kind, size, form)
                    add(args.out, Row("read", kind, form, size, cost([sys.executable, "-c", READ, str(path)], args.out / "log.txt")), path)


def fit(args: argparse.Namespace) -> None:
    for kind, sizes in (("cloud", POINTS), ("mesh", FACES)):
        for size in sizes:
            if size <= args.most:
                path = made(args.out, kind, size, FITTED[kind])
                given = ["-o", str(args.out / "fit"), "--budget", str(BUDGET_S), "language=csg"]
                command = [sys.executable, "-m", "imdim.app.cli", "fit", str(path), *given]
                add(args.out, Row("fit", kind, FITTED[kind], size, cost(command, args.out / "log.txt")), path)


def add(out: Path, row: Row, path: Path) -> None:
    """Note a row beside those of earlier runs, in place of its like."""
    notes = out / "rows.json"
    rows = json.loads(notes.read_text()) if notes.exists() else []
    same = ("what", "kind", "format", "size")
    rows = [r for r in rows if any(r[k] != getattr(row, k) for k in same)] + [asdict(row)]
    notes.write_text(json.dumps(rows, indent=1) + "\n")
    c = row.cost
    failed = "" if c.status == 0 else f"  FAILED with status {c.status}: {(out / 'log.txt').read_text()[-200:]}"
    mb = path.stat().st_size / 1e6
    said = f"{row.what} {row.kind} {row.format:<4} {row.size:>9}  {mb:6.0f} MB  {c.cpu_s:6.1f} s ({c.wall_s:.1f})  {c.mib:6.0f} MiB"
    print(said + failed, flush=True)


def made(out: Path, kind: str, size: int, form: str) -> Path:
    """The file, made unless it is there."""
    path = out.absolute() / f"{kind}-{size}.{form}"
    if not path.exists():
        (write_cloud if kind == "cloud" else write_mesh)(path, size)
    return path


def write_mesh(path: Path, faces: int) -> None:
    """The part with every triangle cut into equal ones until there are about as many."""
    coarse = to_manifold(PART, 64)
    fine = to_trimesh(coarse.refine(max(1, round((faces / coarse.num_tri()) ** 0.5))))
    fine.export(path)


def write_cloud(path: Path, count: int) -> None:
    """Points of the part's surface, in single precision, without normals."""
    mesh = to_trimesh(to_manifold(PART, 512))
    points = sample_surface(np.asarray(mesh.vertices), np.asarray(mesh.faces), count, np.random.default_rng(0))[0].astype("<f4")
    if path.suffix == ".npy":
        np.save(path, points)
    elif path.suffix == ".xyz":
        np.savetxt(path, points, fmt="%.5f")
    elif path.suffix == ".pcd":
        head = f"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\nHEIGHT 1\nPOINTS {count}\nDATA binary\n"
        path.write_bytes(head.encode() + points.tobytes())
    else:
        trimesh.PointCloud(points).export(path)


def plots(args: argparse.Namespace) -> None:
    """Seconds and memory against size, with the slope of the last tenfold step."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    rows = [Row(**{**r, "cost": Cost(**r["cost"])}) for r in json.loads((args.out / "rows.json").read_text())]
    lines = {(r.what, r.kind) for r in rows}
    figure, axes = plt.subplots(1, 2, figsize=(10, 4))
    for what, kind in sorted(lines):
        same = sorted((r for r in rows if (r.what, r.kind, r.format) == (what, kind, FITTED[kind])), key=lambda r: r.size)
        sizes = [r.size for r in same]
        for axis, values in zip(axes, ([r.cost.cpu_s for r in same], [r.cost.mib for r in same]), strict=True):
            slope = np.log(values[-1] / values[-2]) / np.log(sizes[-1] / sizes[-2]) if len(same) > 1 else float("nan")
            label = f"{what} {kind} (.{FITTED[kind]}), last slope {slope:.2f}"
            axis.loglog(sizes, values, marker="o", label=label)
    for axis, title in zip(axes, ("seconds of the processor", "MiB resident at most"), strict=True):
        axis.set(xlabel="points or faces", title=title)
        axis.grid(visible=True, which="both", alpha=0.3)
        axis.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(args.plots / "sizes.png", dpi=110)


if __name__ == "__main__":
    sys.exit(main())
