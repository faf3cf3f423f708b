"""Edit delivered programs by every name: ``python scripts/bench/edits.py FOLDER [--factor 1.05] [--openscad N]``.

FOLDER holds results folders at any depth. Each name of each program is multiplied by the factor, alone, and a count of sides made one
more; the edit is made, or refused with a reason. With ``--openscad N`` N edits, spread over all, are compared with what OpenSCAD makes of
``-D name=value`` on program.scad, and, since OpenSCAD has other spheres and writes six digits, the program as it was with what OpenSCAD
makes of it without an edit.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
import trimesh
from manifold3d import Manifold

from imdim.export.delivered import TEXTS, Delivered, EditError
from imdim.export.edit import change_values, open_delivered, solid_of
from imdim.export.parameters import is_count
from imdim.geometry.solid import mesh_to_manifold, volume_iou
from imdim.program import codec
from imdim.program.cost import count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--factor", type=float, default=1.05)
    parser.add_argument("--openscad", type=int, default=0, metavar="N")
    given = parser.parse_args()
    programs = {path.parent: _opened(path) for path in sorted(given.folder.rglob("program.json")) if (path.parent / TEXTS[0]).exists()}
    seconds, reasons = [], Counter()
    made: list[tuple[Path, str, float]] = []
    for folder, delivered in programs.items():
        for name, old in delivered.values.items():
            value, start = old + 1 if is_count(name) else old * given.factor, time.perf_counter()
            try:
                solid_of(change_values(delivered, {name: value}))
            except EditError as error:
                reasons[_kind(str(error))] += 1
                print(f"{folder}: {error}")
                continue
            seconds.append(time.perf_counter() - start)
            made.append((folder, name, value))
    print(
        f"{len(programs)} programs, {len(made) + sum(reasons.values())} names, {len(made)} edits made, refused: {dict(reasons) or 'none'}"
    )
    if not made:
        return
    largest = max(count(delivered.program).primitives for delivered in programs.values())
    print(f"geometry: median {np.median(seconds):.3f} s, longest {max(seconds):.3f} s; largest program {largest} primitives")
    picks = np.unique(np.linspace(0, len(made) - 1, min(given.openscad, len(made))).round().astype(int))
    ious = np.array([_compared(programs[made[i][0]], *made[i]) for i in picks])
    if len(ious):
        print(f"against OpenSCAD -D: {len(ious)} edits, IoU median {np.median(ious[:, 1]):.7f}, lowest {ious[:, 1].min():.7f};")
        print(f"before the edit: median {np.median(ious[:, 0]):.7f}, lowest {ious[:, 0].min():.7f}")


def _opened(path: Path) -> Delivered:
    texts = {name: (path.parent / name).read_text(encoding="utf-8") for name in TEXTS if (path.parent / name).exists()}
    return open_delivered(codec.parse(path.read_bytes()), texts)


def _kind(reason: str) -> str:
    return "breaks a relation" if "constraints[" in reason else "empty" if "no solid" in reason else "not a size"


def _compared(delivered: Delivered, folder: Path, name: str, value: float) -> tuple[float, float]:
    """IoU of our solid and OpenSCAD's, before the edit and after it."""
    before = volume_iou(solid_of(delivered), _rendered(folder / TEXTS[0]))
    after = volume_iou(solid_of(change_values(delivered, {name: value})), _rendered(folder / TEXTS[0], f"-D{name}={value!r}"))
    print(f"{folder} {name} = {value:g}: IoU {after:.7f}, before the edit {before:.7f}")
    return before, after


def _rendered(text: Path, *options: str) -> Manifold:
    with tempfile.TemporaryDirectory() as place:
        out = Path(place) / "part.stl"
        subprocess.run(["openscad", "-o", str(out), *options, str(text)], check=True, capture_output=True, timeout=300)
        return mesh_to_manifold(trimesh.load_mesh(out))


if __name__ == "__main__":
    main()
