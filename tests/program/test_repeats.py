"""Repeats: what is written once expands to the same solid, by exact booleans; JSON; what is no pattern stays as it is."""

import json
import math
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from program_samples import cloud, inside, random_program
from scripts.make_schema import schema
from tests.planted import box, common, cone, cut, cylinder, sphere, union

from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.codec import dumps, from_json, loads, parse, read_folded, to_json
from imdim.program.motions import mirror, move_program, step, turn
from imdim.program.patterns.congruence import node_of
from imdim.program.patterns.detect import extent, fold_repeats, to_layers
from imdim.program.repeats import Group, Repeat, expand, instances, repeats, size, with_leaves
from imdim.program.tree import KINDS, Combine, Primitive, leaves

VALIDATOR = jsonschema.Draft202012Validator(schema())
HOLE = cylinder(2, 20)
PLATE = box(200, 160, 8)


def written(folded) -> int:
    """How many primitives are written out."""
    if isinstance(folded, Primitive):
        return 1
    return written(folded.part) if isinstance(folded, Repeat) else sum(map(written, folded.parts))


def same_solid(a, b) -> bool:
    return volume_iou(to_manifold(a, 32), to_manifold(b, 32)) == pytest.approx(1, abs=1e-6)


def shuffled(parts: list, seed: int) -> list:
    return [parts[i] for i in np.random.default_rng(seed).permutation(len(parts))]


def at(part, *places) -> list:
    return [move_program(part, step(place)) for place in places]


def grid(part, n: int, m: int, dx: float, dy: float, x: float = 0.0, y: float = 0.0) -> list:
    return at(part, *((x + i * dx, y + j * dy, 0.0) for i in range(n) for j in range(m)))


def around(part, n: int, degrees: float | None = None, point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)) -> list:
    return [move_program(part, turn(point, axis, i * (degrees or 360 / n))) for i in range(n)]


BOSS = cut(cylinder(6, 10, (40, 0, 5)), cylinder(3, 12, (40, 0, 5)), box(2, 20, 2, (40, 0, 9)))
TOOTH = box(8, 4, 6, (30, 0, 0))
CASES = {
    "row": (cut(PLATE, *at(HOLE, *((-60 + 30 * i, 10.0, 0.0) for i in range(5)))), [("linear", (5,))], 2),
    "slanted row": (cut(PLATE, *at(HOLE, *((11.0 * i, 7.0 * i, 0.0) for i in range(4)))), [("linear", (4,))], 2),
    "grid": (cut(PLATE, *grid(HOLE, 3, 4, 20, 15)), [("grid", 12)], 2),
    "circle": (cut(cylinder(60, 8), *around(cylinder(3, 20, (40, 0, 0)), 6)), [("circular", (6,))], 2),
    "arc": (cut(cylinder(60, 8), *around(cylinder(3, 20, (40, 0, 0)), 5, 20.0)), [("circular", (5,))], 2),
    "teeth": (union(cylinder(28, 6), *around(TOOTH, 11)), [("circular", (11,))], 2),
    "star": (union(sphere(6), *around(box(60, 4, 4), 3, 60.0)), [("circular", (3,))], 2),
    "bosses": (union(cylinder(60, 4), *around(BOSS, 7)), [("circular", (7,))], 4),
    "two circles": (
        cut(cylinder(60, 8), *around(cylinder(3, 20, (40, 0, 0)), 6), *around(cone(3, 5, 2, (40, 0, 3.5)), 6)),
        [("circular", (6,))],
        3,
    ),
    "mirror": (
        union(box(40, 30, 10), BOSS, move_program(BOSS, mirror((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)))),
        [("mirror", (2,))],
        4,
    ),
    "mirrored pair": (
        union(box(40, 30, 10), *(p for s in (-1, 1) for p in (box(8, 6, 30, (12.0 * s, 5, 10)), cone(4, 2, 9, (16.0 * s, -7, 9))))),
        [("mirror", (2,))],
        3,
    ),
    "corners": (
        cut(
            PLATE,
            *(cut(box(8, 8, 20, (100 * x, 80 * y, 0)), cylinder(4, 30, (96 * x, 76 * y, 0))) for x in (-1.0, 1.0) for y in (-1.0, 1.0)),
        ),
        [("mirror", (2,)), ("mirror", (2,))],
        3,
    ),
    "common to balls": (common(box(40, 20, 30), *around(sphere(30, (14, 0, 0)), 6)), [("circular", (6,))], 2),
    "common to groups": (
        common(
            box(90, 80, 30),
            *(union(cylinder(30, 40, (x, y, 0)), box(9, 9, 50, (x, y + 2, 0))) for x in (-8.0, 8.0) for y in (-5.0, 0.0, 5.0)),
        ),
        [("grid", (2, 3))],
        3,
    ),
    "row and single": (cut(PLATE, *at(HOLE, (0, 0, 0), (20, 0, 0), (40, 0, 0), (7, 30, 0))), [("linear", (3,))], 3),
    "row of pairs of rows": (
        cut(
            PLATE,
            *(
                cut(box(20, 12, 20, (30.0 * i, 0, 0)), *at(cylinder(1, 30), *((30 * i + 5.0 * k, 0, 0) for k in (-1, 0, 1))))
                for i in range(3)
            ),
        ),
        [("linear", (3,)), ("linear", (3,))],
        3,
    ),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("pose", range(3))
def test_patterns_come_out_whatever_the_order_and_the_pose(name: str, pose: int):
    program, expected, left = CASES[name]
    node = node_of(program)
    if pose:
        keep = 1 if node.op == "difference" else 0
        spine = [program]
        while isinstance(spine[-1], Combine) and spine[-1].op == node.op:
            spine.append(spine[-1].left)
        operands = [spine[-1], *(s.right for s in reversed(spine[:-1]))]
        operands = operands[:keep] + shuffled(operands[keep:], pose)
        program = {"difference": cut, "union": union, "intersection": common}[node.op](*operands)
        axis = np.random.default_rng(pose).normal(size=3)
        motion = turn((1.0, 2.0, 3.0), tuple((axis / np.linalg.norm(axis)).tolist()), 37.0 * pose)
        program = move_program(program, motion) if pose == 1 else program
    found = fold_repeats(program)
    assert found is not None
    kinds = [(r.kind, r.counts if kind[1] != 12 else r.number) for (_, r), kind in zip(repeats(found.folded), expected, strict=True)]
    assert kinds == expected
    assert written(found.folded) == left
    assert same_solid(found.program, program)
    assert sorted(found.order) == list(range(len(node.leaves)))
    old, new = list(leaves(program)), list(leaves(found.program))
    assert max(math.dist(old[o].center, p.center) for o, p in zip(found.order, new, strict=True)) <= 1e-5 * extent(program)
    assert [old[o].kind for o in found.order] == [p.kind for p in new]


@pytest.mark.parametrize("seed", range(20))
def test_random_patterns_in_random_places(seed: int):
    """Planted: a random part copied by a random motion, among others of random sizes. Found: no more is written than was planted."""
    rng = np.random.default_rng(seed)
    part = random_program(rng, int(rng.integers(1, 4)), ops=("union",), kinds=KINDS)
    kind, n = ("linear", "grid", "circular")[seed % 3], int(rng.integers(3, 7))
    axis = rng.normal(size=3)
    steps = tuple(tuple((rng.normal(size=3) * 6).tolist()) for _ in range(2))
    counts = (n,) if kind != "grid" else (2, n)
    planted = Repeat(
        kind,
        node_folded(part),
        counts,
        steps[: len(counts)] if kind != "circular" else (),
        tuple((rng.normal(size=3) * 5).tolist()),
        tuple((axis / np.linalg.norm(axis)).tolist()),
        360 / n,
    )
    others = [box(*(rng.uniform(3, 9, 3)), tuple((20 * rng.normal(size=3)).tolist())) for _ in range(2)]
    program = expand(Group("union", (*others, planted)))
    found = fold_repeats(program)
    assert found is not None
    assert written(found.folded) <= written(planted) + 2
    assert same_solid(found.program, program)
    document = json.loads(dumps(found.program, None, (), found.folded))
    VALIDATOR.validate(document)
    assert from_json(document) == found.program
    assert read_folded(document) == found.folded


def node_folded(program):
    """The plain folded form, by the codec."""
    return read_folded(to_json(program))


NOT_THERE = {
    "two holes": cut(PLATE, *at(HOLE, (0, 0, 0), (30, 0, 0))),
    "unequal steps": cut(PLATE, *at(HOLE, (0, 0, 0), (20, 0, 0), (41, 0, 0))),
    "unequal radii": cut(PLATE, *(cylinder(r, 20, (x, 0, 0)) for r, x in ((2, -20), (2.01, 0), (2, 20)))),
    "unequal angles": cut(cylinder(60, 8), *(cylinder(3, 20, (40 * math.cos(a), 40 * math.sin(a), 0)) for a in (0.0, 1.0, 2.1))),
    "off by a hair": cut(PLATE, *at(HOLE, (0, 0, 0), (20, 0.01, 0), (40, 0, 0))),
    "isosceles": cut(PLATE, *at(HOLE, (-10, 0, 0), (10, 0, 0), (0, 35, 0))),
    "one turned": union(PLATE, *(box(6, 3, 20, (x, 0, 0), (0.0, 0.0, a)) for x, a in ((-20, 0.0), (0, 10.0), (20, 0.0)))),
    "single": HOLE,
}


@pytest.mark.parametrize("name", NOT_THERE)
def test_what_does_not_repeat_is_left_alone(name: str):
    assert fold_repeats(NOT_THERE[name]) is None


def test_a_wider_tolerance_makes_near_patterns_exact():
    program = NOT_THERE["off by a hair"]
    found = fold_repeats(program, 0.05)
    assert found is not None
    assert [r.counts for _, r in repeats(found.folded)] == [(3,)]
    steps = np.diff([p.center for p in list(leaves(found.program))[1:]], axis=0)
    assert np.ptp(steps, axis=0) == pytest.approx(0)


def test_parts_found_one_by_one_are_brought_together():
    """((plate | b1 - h1) | b2) - h2 ..: bosses and holes that do not meet trade places, and the hole that meets the last block does not."""
    program = PLATE
    for x in (-60.0, -20.0, 20.0):
        program = Combine("difference", Combine("union", program, cylinder(6, 20, (x, 40, 8))), cylinder(2, 20, (x, -40, 0)))
    program = Combine("difference", Combine("union", program, box(9, 9, 9, (60, -40, 0))), cylinder(2, 20, (60, -40, 0)))
    found = fold_repeats(program)
    assert found is not None
    assert sorted((r.kind, r.counts) for _, r in repeats(found.folded)) == [("linear", (3,)), ("linear", (4,))]
    assert same_solid(found.program, program)


@pytest.mark.parametrize("seed", range(30))
@pytest.mark.parametrize("late", [False, True])
def test_layers_keep_the_solid(seed: int, late: bool):
    rng = np.random.default_rng(seed)
    program = box(4, 4, 4)
    for _ in range(10):
        leaf = Primitive("sphere", (float(rng.uniform(0.3, 1.5)),), tuple(rng.uniform(-3, 3, 3).tolist()))
        program = Combine(("union", "difference")[int(rng.integers(2))], program, leaf)
    node = to_layers(node_of(program), late)
    again = as_program(node)
    points = rng.uniform(-5, 5, (4000, 3))
    assert np.array_equal(inside(again, points), inside(program, points))
    assert sorted(n for n, _ in node.leaves) == list(range(11))


def as_program(node):
    return node.leaf or {"union": union, "difference": cut, "intersection": common}[node.op](*map(as_program, node.parts))


@pytest.mark.parametrize(
    "motion", [step((1.0, 2.0, 3.0)), turn((1.0, 0.0, 2.0), (0.6, 0.0, 0.8), 50.0), mirror((1.0, 2.0, 3.0), (0.0, 0.6, 0.8))]
)
@pytest.mark.parametrize("seed", range(8))
def test_a_moved_program_is_inside_where_its_points_go(motion, seed: int):
    program = random_program(np.random.default_rng(seed), 4)
    points = cloud(np.random.default_rng(seed))
    there = points @ np.array(motion.linear).T + motion.shift
    assert (inside(move_program(program, motion), there) == inside(program, points)).mean() > 0.999


def test_instances_say_what_each_leaf_is_a_copy_of():
    found = fold_repeats(CASES["row of pairs of rows"][0])
    assert found is not None
    parts = list(leaves(found.program))
    for leaf, (source, motion) in zip(parts, instances(found.folded), strict=True):
        assert math.dist(motion.point(parts[source].center), leaf.center) < 1e-9
    bigger = expand(with_leaves(found.folded, found.program))
    assert bigger == found.program
    assert size(found.folded) == len(parts)


# --- JSON ------------------------------------------------------------------------------------------------------------


def document(**changes) -> dict:
    repeat = {"repeat": "linear", "count": 3, "step": [10, 0, 0], "part": to_json(HOLE)["program"], **changes}
    return {"format": "imdim-csg", "version": 3, "program": {"op": "difference", "parts": [to_json(PLATE)["program"], repeat]}}


def test_a_repeat_reads_as_its_copies():
    assert from_json(document()) == cut(PLATE, *at(HOLE, (0, 0, 0), (10, 0, 0), (20, 0, 0)))
    VALIDATOR.validate(document())
    found = fold_repeats(CASES["grid"][0])
    assert found is not None
    text = dumps(found.program, None, (), found.folded)
    assert '"counts": [' in text
    assert '"version": 3' in text
    assert loads(text) == found.program
    again = parse(text)
    assert dumps(from_json(again), None, (), read_folded(again)) == text


def test_copies_may_be_intersected():
    meant = common(*at(HOLE, (0, 0, 0), (1, 0, 0), (2, 0, 0)))
    assert from_json(document(step=[1, 0, 0], join="intersection")) == cut(PLATE, meant)
    VALIDATOR.validate(document(join="intersection"))
    found = fold_repeats(CASES["common to balls"][0])
    assert found is not None
    text = dumps(found.program, None, (), found.folded)
    assert '"join": "intersection"' in text
    VALIDATOR.validate(parse(text))
    assert read_folded(parse(text)) == found.folded


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"join": "difference"}, "$.program.parts[1].join: expected union or intersection, got 'difference'"),
        ({"repeat": "spiral"}, "$.program.parts[1].repeat: expected linear or grid or circular or mirror, got 'spiral'"),
        ({"count": 1}, "$.program.parts[1].count: expected a whole number from 2 to 10000, got 1"),
        ({"count": 2.5}, "$.program.parts[1].count: expected a whole number from 2 to 10000, got 2.5"),
        ({"count": True}, "$.program.parts[1].count: expected a whole number from 2 to 10000, got True"),
        ({"step": [0, 0, 0]}, "$.program.parts[1]: linear of (3,) has steps ((0.0, 0.0, 0.0),)"),
        ({"step": [1, 2]}, "$.program.parts[1].step: expected a list of 3 numbers, got 2 entries"),
        ({"stride": 2}, "$.program.parts[1]: unknown key 'stride'; did you mean 'step'?"),
        ({"count": 10000}, "$.program.parts[1].part: more than 10000 primitives"),
    ],
)
def test_what_is_wrong_with_a_repeat_is_said(changes: dict, message: str):
    with pytest.raises(ValueError, match="\\$") as caught:
        from_json(document(**changes))
    assert str(caught.value) == message


def test_repeats_in_repeats_do_not_explode():
    node: dict = to_json(HOLE)["program"]
    for _ in range(60):
        node = {"repeat": "linear", "count": 1000, "step": [1, 0, 0], "part": node}
    with pytest.raises(ValueError, match="more than 10000 primitives"):
        from_json({"format": "imdim-csg", "version": 3, "program": node})


def test_earlier_versions_have_no_repeats():
    with pytest.raises(ValueError, match="version 2 has no repeats"):
        from_json({**document(), "version": 2})


def test_a_mirror_of_two_counts_is_refused():
    good = Repeat("mirror", HOLE, (2,), axis=(1.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="mirror makes 2"):
        replace(good, counts=(3,))
    with pytest.raises(ValueError, match="axis of length 1"):
        replace(good, axis=(1.0, 1.0, 0.0))
