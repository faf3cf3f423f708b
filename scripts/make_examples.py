"""Make the example parts from their OpenSCAD source: ``python scripts/make_examples.py`` writes bracket.stl and bracket_cloud.ply."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

import numpy as np
import trimesh

from imdim.target.scan import Condition, scan
from imdim.target.target import load_target

EXAMPLES = Path(__file__).parents[1] / "dataset" / "examples"
CLOUD_POINTS = 12_000
CLOUD_NOISE = 0.003  # of the box diagonal


def main() -> None:
    source, part, cloud = (EXAMPLES / name for name in ("bracket.scad", "bracket.stl", "bracket_cloud.ply"))
    with tempfile.TemporaryDirectory() as folder:
        text = Path(folder) / "bracket.stl"
        subprocess.run(["openscad", "-o", str(text), str(source)], check=True, capture_output=True)
        mesh = trimesh.load_mesh(text)
    part.write_bytes(trimesh.exchange.stl.export_stl(mesh))  # OpenSCAD 2021 writes text, four times as large
    target = load_target(part)
    assert target.mesh is not None
    points, _ = scan(target.mesh, Condition(noise=CLOUD_NOISE), np.random.default_rng(0), CLOUD_POINTS)
    trimesh.PointCloud(points.astype(np.float32)).export(cloud)
    print(f"{part}: {len(target.mesh.faces)} faces\n{cloud}: {len(points)} points")


if __name__ == "__main__":
    main()
