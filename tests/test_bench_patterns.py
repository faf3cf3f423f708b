"""The bench of patterns sees planted features in meshes, and nothing in parts that have none."""

import importlib.util
import json
import math
import sys
from pathlib import Path
from types import ModuleType

import pytest
import trimesh
from tests.planted import PARTS, box, cut, cylinder, mesh_of

from imdim.program.codec import to_json
from imdim.program.patterns.detect import fold_repeats
from imdim.program.tree import Program


def load_script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, Path(__file__).parents[1] / "scripts" / "bench" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # dataclasses look their module up
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


bench = load_script("patterns")

ROW = cut(box(90, 20, 8), *(cylinder(2, 20, (x, 3.0, 0.0)) for x in (-30.0, -10.0, 10.0, 30.0)))
RING = cut(cylinder(40, 8), *(cylinder(3, 20, (30 * math.cos(a), 30 * math.sin(a), 0.0)) for a in [i * math.tau / 5 for i in range(5)]))
SKEW = cut(box(90, 20, 8), *(cylinder(2, 20, (x, 3.0, 0.0)) for x in (-30.0, -10.0, 17.0)))
POCKETS = cut(box(90, 20, 8), *(box(10, 8, 8, (x, 3.0, 4.0)) for x in (-30.0, 0.0, 30.0)))


def found(program: Program) -> list[tuple[str, int]]:
    mesh: trimesh.Trimesh = mesh_of(program, 48)
    mesh.merge_vertices()
    return [(p.kind, len(p.places)) for p in bench.patterns(mesh)]


@pytest.mark.parametrize(
    ("program", "expected"),
    [
        (ROW, ("in a row", 4)),
        (RING, ("on a circle", 5)),
        (PARTS["plate with four holes"], ("in a grid", 4)),
        (POCKETS, ("in a row", 3)),
    ],
)
def test_planted_patterns_are_seen_and_explained(program: Program, expected: tuple[str, int], tmp_path):
    assert found(program)[0] == expected
    folding = fold_repeats(program)
    assert folding is not None
    node = json.loads(json.dumps(to_json(folding.program, None, (), folding.folded)))["program"]
    pattern = bench.patterns(mesh_of(program, 48))[0]
    assert any(bench.explained(pattern, motions, 0.1) for motions in bench.repeats_of(node))
    assert not bench.repeats_of(to_json(program)["program"])


def test_a_mirror_of_a_mirror_makes_four():
    corners = (cut(box(8, 8, 20, (40 * x, 20 * y, 0)), cylinder(5, 30, (36 * x, 16 * y, 0))) for x in (-1.0, 1.0) for y in (-1.0, 1.0))
    program = cut(box(80, 40, 6), *corners)
    assert found(program)[0] == ("in a grid", 4)
    folding = fold_repeats(program)
    assert folding is not None
    node = to_json(folding.program, None, (), folding.folded)["program"]
    assert any(bench.explained(bench.patterns(mesh_of(program, 48))[0], motions, 0.1) for motions in bench.repeats_of(node))


@pytest.mark.parametrize("program", [SKEW, PARTS["L bracket"], PARTS["tube on a flange"], PARTS["stepped shaft"], PARTS["bored ball"]])
def test_parts_without_patterns_have_none(program: Program):
    assert found(program) == []
