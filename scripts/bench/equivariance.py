"""Whether a part gives the same answer when it is turned, scaled, moved, reordered, subdivided, decimated, rounded to single precision or
mirrored.

    OMP_NUM_THREADS=1 python scripts/bench/equivariance.py PART... [--budget 40] [--language cad] [--variants turned subdivided ...]
        [--clock processor]

Each part is reconstructed as it is and in each variant, which bound the same solid up to a similarity. Told are the features and the IoU
with the variant's own mesh; the last line counts how many have as many features as the part itself, and the largest change of their IoU.
Exit status 1: fewer than 95 % have as many, or an IoU changed by more than 5e-4.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
from processor import CLOCKS, rule_the_clock

from imdim.delivery.first_run import compile_kernels
from imdim.geometry.solid import mesh_to_manifold, to_manifold, to_trimesh, volume_iou
from imdim.program.cost import count
from imdim.reconstruction.config import LANGUAGES, Settings
from imdim.reconstruction.pipeline import reconstruct_best
from imdim.target.target import load_target, target_from

SAME = 0.95  # of the variants have as many features
IOU = 5e-4
SEGMENTS = 768  # of a circle, of which the facets of a turned one are no matter
TURN = trimesh.transformations.rotation_matrix(np.radians(30), [1, 2, 3])
NO_TOLERANCE = 1e-9  # of the diagonal


class Answer(NamedTuple):
    """What one reconstruction gave."""

    features: int
    iou: float
    stop: str


def moved_by(transform: np.ndarray) -> Callable[[trimesh.Trimesh], trimesh.Trimesh]:
    """Vertices by a similarity [4, 4]; a mirror turns the faces too."""
    return lambda mesh: mesh.copy().apply_transform(transform)


def reorder(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Other vertices, faces and first corners come first."""
    rng = np.random.default_rng(0)
    places = rng.permutation(len(mesh.vertices))
    faces = np.argsort(places)[mesh.faces][rng.permutation(len(mesh.faces))]
    return trimesh.Trimesh(mesh.vertices[places], np.roll(faces, 1, axis=1), process=False)


def decimate(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Without the vertices that the solid does not need."""
    solid = mesh_to_manifold(mesh)
    return to_trimesh(solid.simplify(NO_TOLERANCE * float(np.linalg.norm(mesh.extents))))


def to_single(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices.astype(np.float32).astype(float), mesh.faces, process=False)


VARIANTS: Mapping[str, Callable[[trimesh.Trimesh], trimesh.Trimesh]] = {
    "turned": moved_by(TURN),
    "scaled": moved_by(np.diag([1000.0, 1000.0, 1000.0, 1.0])),
    "moved": moved_by(trimesh.transformations.translation_matrix([3.1, -4.7, 11.3])),
    "reordered": reorder,
    "subdivided": lambda mesh: mesh.copy().subdivide(),
    "decimated": decimate,
    "single": to_single,
    "mirrored": moved_by(np.diag([-1.0, 1.0, 1.0, 1.0])),
}


def main() -> int:
    """Reconstruct all, and tell; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="+", type=Path)
    parser.add_argument("--budget", type=float, default=40.0)
    parser.add_argument("--language", choices=LANGUAGES, default=LANGUAGES[-1])
    parser.add_argument("--variants", nargs="+", choices=list(VARIANTS), default=list(VARIANTS))
    parser.add_argument("--clock", choices=CLOCKS, default="wall", help="what tells the budget: the processor's does not mind other work")
    args = parser.parse_args()
    compile_kernels(sys.stderr)  # which would shorten the first part's budget
    if args.clock == "processor":
        rule_the_clock()
    settings, same, changes, several = Settings(budget_s=args.budget, language=args.language), 0, [0.0], 0
    for part in args.parts:
        mesh = load_target(part).mesh
        if mesh is None:
            raise SystemExit(f"{part}: no mesh")
        base = answer(mesh, settings)
        print(f"{part.name}: {base.features} features, IoU {base.iou:.5f} ({base.stop})", flush=True)
        for name in args.variants:
            got = answer(VARIANTS[name](mesh), settings)
            several += 1
            if got.features == base.features:
                same, changes = same + 1, [*changes, abs(got.iou - base.iou)]
            print(f"  {name:<10} {got.features:3} IoU {got.iou:.5f} ({got.stop})", flush=True)
    print(f"{same} of {several} variants have as many features; their IoU changes by {max(changes):.1e} at most")
    return int(same < SAME * several or max(changes) > IOU)


def answer(mesh: trimesh.Trimesh, settings: Settings) -> Answer:
    """The reconstruction of a mesh, scored by exact booleans."""
    target = target_from(mesh)
    if target.mesh is None or not target.is_solid:
        raise SystemExit("a variant bounds no solid")
    last = reconstruct_best(target, settings)
    return Answer(
        count(last.program).primitives, volume_iou(to_manifold(last.program, SEGMENTS), mesh_to_manifold(target.mesh)), last.stop or ""
    )


if __name__ == "__main__":
    raise SystemExit(main())
