"""Relations among leaves with outlines: faces, axes and heights of extrusions; alike ones stand in rows, those of other shapes do not."""

from dataclasses import replace

import numpy as np
from tests.drawn import BRACKET, PULLEY, centred, slot

from imdim.geometry.lowering import lower, pack, unpack
from imdim.geometry.pose import Pose
from imdim.geometry.sampling import surface_points
from imdim.numbers.refine import refine
from imdim.program.constraints import Constraint, Ref
from imdim.program.outline import Outline, circle
from imdim.program.tree import Combine, Primitive, combine_all, leaves
from imdim.relations.belief import DeterminedFaces
from imdim.relations.directions import Directions
from imdim.relations.discover import discover, exact_relations, hold_constraints
from imdim.relations.features import Places
from imdim.relations.places import may_be_congruent
from imdim.relations.residuals import verify

PLATE = centred(BRACKET, 8.0, 4.0)
SLOTS = [centred(Outline((slot(x, 5.0, 6.0, 1.5),)), 20.0, 4.0) for x in (20.0, 30.0, 40.0)]
PART = combine_all("difference", [PLATE, *SLOTS])


def test_numbers_of_outlined_leaves_are_fitted_and_outlines_stay():
    rng = np.random.default_rng(0)
    points = surface_points(PART, 6000, rng)[0]
    _, params = pack(PART)
    off = params + np.hstack(
        [0.2 * rng.uniform(-1, 1, (4, 1)), np.zeros((4, 2)), 0.2 * rng.uniform(-1, 1, (4, 3)), rng.uniform(-1, 1, (4, 3))]
    )
    fit = refine(unpack(PART, off), points)
    assert [leaf.outline for leaf in leaves(fit.program)] == [leaf.outline for leaf in leaves(PART)]
    assert fit.rms < 1e-4
    plate = next(leaves(fit.program))
    assert np.abs(np.subtract((*plate.size, *plate.center), (*PLATE.size, *PLATE.center))).max() < 1e-3


def test_relations_of_extrusions_are_found_and_hold():
    points = surface_points(PART, 4000, np.random.default_rng(1))[0]
    found = discover(PART, points)
    verify(found.program, found.constraints)
    kinds = {c.kind for c in found.constraints}
    assert "parallel" in kinds
    # each says that the three slots are evenly apart
    assert kinds & {"linear", "symmetric", "circular"}
    assert all(ref.feature != "angle" for c in found.constraints for ref in c.of)
    assert [leaf.outline for leaf in leaves(found.program)] == [leaf.outline for leaf in leaves(PART)]


def test_exact_relations_name_heights_and_ends():
    twin = Combine("union", PLATE, replace(PLATE, center=(130.0, 20.0, 4.0), outline=Outline((circle(10.0),))))
    found = exact_relations(Combine("union", twin, replace(PULLEY, center=(130.0, 20.0, 30.0))))
    text = [str(c) for c in found.constraints]
    assert "equal of 0.h, 1.h" in text
    assert any(c.kind == "coplanar" for c in found.constraints)
    assert any(c.kind == "coaxial" and {r.leaf for r in c.of} == {1, 2} for c in found.constraints)


def test_held_faces_move_the_leaf_and_not_its_outline():
    raised = Combine("union", PLATE, replace(SLOTS[0], center=(20.0, 5.0, 5.0)))
    level = Constraint("coplanar", (Ref(0, "-z"), Ref(1, "-z")), None, 6.0)
    moved, held = hold_constraints(raised, [level])
    assert held == (level,)
    assert [leaf.outline for leaf in leaves(moved)] == [PLATE.outline, SLOTS[0].outline]


def test_outlines_are_alike_whatever_their_frame():
    turned = replace(SLOTS[0], rotation=(0.0, 0.0, 30.0), outline=Outline((slot(1.0, 2.0, 6.0, 1.5, True),)))
    other = replace(SLOTS[0], outline=Outline((slot(0.0, 0.0, 6.2, 1.5),)))
    numbers = lower(combine_all("union", [SLOTS[0], turned, other, Primitive("box", (1.0, 1.0, 1.0))]))
    places = Places(Pose.of(numbers), np.eye(36), DeterminedFaces.everything(numbers), Directions())
    assert [may_be_congruent(places, 0, leaf) for leaf in range(3)] == [True, True, False]
