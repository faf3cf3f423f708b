"""Compare the faces of delivered STEP files with those of the true parts: ``python scripts/bench/surfaces.py RESULTS --truth TRUTH``

RESULTS holds results folders, of benchmark.py or of `imdim fit`, named as their parts. TRUTH is a JSON file whose `parts` have, by name,
`surface_parameters`: for `cylinder_radius`, `cone_half_angle_deg`, `torus_major_minor` and `sphere_radius` how many faces have each size.
They are the bores, bosses, fillets and round chamfers of the part; what `operations_in_script` says was drawn as a fillet or a chamfer is
told beside them. A size of the truth is found where a face of the kind has it within `RIGHT`; a size that no true face has is strange.
Round faces of the truth that are themselves facets or splines are not in it, so that strange ones may be right. A part without a STEP file
has lost all of its sizes; one without a folder is named, and counts nowhere.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from imdim.export.step import StepError, read_step
from imdim.export.step_booleans import ocp

RIGHT = 0.02  # of a size
BLENDS = ("fillet", "chamfer")
Sizes = tuple[float, ...]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("--truth", type=Path, required=True)
    args = parser.parse_args()
    parts: Mapping[str, Any] = json.loads(args.truth.read_text(encoding="utf-8"))["parts"]
    total: Counter[str] = Counter()
    for name, truth in sorted(parts.items()):
        if not (args.results / name).is_dir():
            print(f"{name}: not in {args.results}")
            continue
        drawn = {kind: count for kind, count in truth["operations_in_script"].items() if kind in BLENDS}
        try:
            shape = read_step(args.results / name / "program.step")
            found, count = set(round_faces(shape)), len(list(faces_of(shape)))
        except StepError:  # then all of its sizes are lost
            found, count = set[tuple[str, Sizes]](), 0
        sizes = [(kind, tuple(map(float, size.split("/")))) for kind, each in truth["surface_parameters"].items() for size in each]
        lost = [(kind, size) for kind, size in sizes if not any(is_one(kind, size, other) for other in found)]
        strange = {other for other in found if not any(is_one(kind, size, other) for kind, size in sizes)}
        own = Counter({"parts": 1, "sizes": len(sizes), "found": len(sizes) - len(lost), "strange": len(strange), "own": len(found)})
        own["files"], own["faces"], own["true faces"] = int(count > 0), count, truth["faces"]
        told = "".join(f", {kind}s {times}" for kind, times in drawn.items())
        print(f"{name}: {'' if count else 'no STEP, '}{own['found']} of {len(sizes)}, {len(strange)} of {len(found)} strange{told}")
        for said, some in (("lost", lost), ("strange", sorted(strange))):
            if some:
                print(f"    {said}: " + ", ".join(f"{kind.split('_')[0]} {'/'.join(f'{v:.5g}' for v in size)}" for kind, size in some))
        total += own + Counter({f"{key} of blended": value for key, value in own.items() if drawn})
    for whose in ("", " of blended"):
        n = {key: total[key + whose] for key in ("parts", "files", "sizes", "found", "strange", "own", "faces", "true faces")}
        which = "parts with fillets or chamfers in their script" if whose else "parts"
        share = n["found"] / max(n["sizes"], 1)
        print(f"{n['parts']} {which}, {n['files']} with STEP: {n['found']} of {n['sizes']} sizes ({share:.3f}), ", end="")
        print(f"{n['strange']} of {n['own']} strange, {n['faces']} faces for {n['true faces']}")
    return 0


def is_one(kind: str, size: Sizes, other: tuple[str, Sizes]) -> bool:
    return kind == other[0] and all(abs(a - b) <= RIGHT * max(abs(b), 1e-9) for a, b in zip(size, other[1], strict=True))


def faces_of(shape: Any) -> Iterator[Any]:
    kind = ocp("TopAbs").TopAbs_ShapeEnum.TopAbs_FACE
    explorer = ocp("TopExp").TopExp_Explorer(shape, kind)
    while explorer.More():
        yield ocp("TopoDS").TopoDS.Face(explorer.Current())
        explorer.Next()


def round_faces(shape: Any) -> Iterator[tuple[str, Sizes]]:
    """The kind and the sizes of each face that is a cylinder, a cone, a torus or a sphere, by the words of the truth."""
    for face in faces_of(shape):
        surface = ocp("BRepAdaptor").BRepAdaptor_Surface(face)
        kind = surface.GetType().name.removeprefix("GeomAbs_")
        if kind == "Cylinder":
            yield "cylinder_radius", (round(surface.Cylinder().Radius(), 6),)
        elif kind == "Cone":
            yield "cone_half_angle_deg", (round(abs(surface.Cone().SemiAngle()) * 57.29577951308232, 4),)
        elif kind == "Sphere":
            yield "sphere_radius", (round(surface.Sphere().Radius(), 6),)
        elif kind == "Torus":
            yield "torus_major_minor", (round(surface.Torus().MajorRadius(), 6), round(surface.Torus().MinorRadius(), 6))


if __name__ == "__main__":
    sys.exit(main())
