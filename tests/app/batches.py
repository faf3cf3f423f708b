"""Files that stand for parts, a script that does what the name of a part says instead of fitting it, and the table of their batch."""

from __future__ import annotations

import csv
from pathlib import Path

# what a part does is decided by its name; every start and every end is a line of a file that is not part of the batch
STAND_IN = """
import json, os, pathlib, sys, time
source, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[3])
note = lambda what: open(LOG, "a", errors="surrogateescape").write(f"{what} {source.stem}\\n")
note("start")
if source.stem == "crash":
    os.abort()
if source.stem == "hang":
    child = f"import os, time; print('child', os.getpid(), file=open({LOG!r}, 'a')); time.sleep(600)"
    os.spawnl(os.P_NOWAIT, sys.executable, sys.executable, "-c", child)
    time.sleep(600)
if source.stem == "blowup":
    hoard = []
    while True:
        hoard.append(b"x" * (1 << 24))
if source.stem == "refused":
    sys.exit("imdim: refused.stl: 0 points")
time.sleep(PAUSE)
out.mkdir(parents=True)
result = {"primitives": 4, "features": 4, "curves": 45} if source.stem == "drawn" else {"primitives": 7}
report = {"result": result, "stop": "finished", "scores": {"volume_iou": 0.5,
    "distance_relative_to_diagonal": {"target_to_result": {"mean": 0.25}}}}
(out / "report.json").write_text(json.dumps(report))
(out / "preview.png").write_bytes(b"png")
note("end")
"""


def make(parts: Path, *names: str) -> None:
    for name in names:
        (parts / name).write_bytes(name.encode("utf-8", "surrogateescape"))


def rows(out: Path) -> dict[str, dict[str, str]]:
    with (out / "results.csv").open(newline="") as file:
        return {row["input"]: row for row in csv.DictReader(file)}
