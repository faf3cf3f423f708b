"""Rounding to typed numbers: taken where it costs nothing of the target, left where the target has other numbers."""

from dataclasses import replace

import numpy as np
import pytest
from tests.deadlines import PASSED
from tests.planted import box, common, cone, cut, cylinder, mesh_of, union

from imdim.deadline import NEVER
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.geometry.surface import signed_distance
from imdim.program.outline import Outline
from imdim.program.tree import Primitive, leaves
from imdim.reconstruction import observation, one_body, rounding
from imdim.reconstruction.config import Settings
from imdim.reconstruction.fitting import fit_numbers
from imdim.reconstruction.observation import UnitBody, observe
from imdim.reconstruction.rounding import SNAP_CHANGE, SNAP_LOSS, snap_numbers
from imdim.target.target import in_unit_frame, target_from


def seen_of(mesh):
    """What is seen of a mesh, and its frame."""
    unit, frame = in_unit_frame(target_from(mesh))
    rng = np.random.default_rng(0)
    return observe(UnitBody.of(unit, rng), Settings().size_weight, rng), frame


def rounded(program, mesh, deadline=NEVER):
    return snap_numbers(program, *seen_of(mesh), deadline)


def test_typed_numbers_come_back():
    truth = cut(box(40, 30, 6), cylinder(3, 8))
    plate, hole = leaves(rounded(cut(box(40.0004, 29.9998, 6.0001), cylinder(3.0002, 8)), mesh_of(truth)))
    assert plate.size == (40.0, 30.0, 6.0)
    assert hole.size[0] == 3.0


def test_numbers_that_the_target_does_not_have_are_not_rounded_to():
    odd = box(40.006, 30.0045, 6.0009)
    mesh = mesh_of(odd)
    kept = rounded(odd, mesh)
    assert volume_iou(to_manifold(kept), mesh_to_manifold(mesh)) > 1 - 1e-4
    assert next(leaves(kept)).size == pytest.approx((40.006, 30.0045, 6.0009), abs=5e-3)


def test_an_open_mesh_is_rounded_by_distance():
    mesh = mesh_of(box(40, 30, 6))
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    assert next(leaves(rounded(box(40.0004, 29.9998, 6.0001), mesh))).size == (40.0, 30.0, 6.0)


def test_no_time_leaves_the_numbers():
    assert next(leaves(rounded(box(40.0004, 29.9998, 6.0001), mesh_of(box(40, 30, 6)), PASSED))).size[0] == 40.0004


def test_an_odd_hole_becomes_like_its_fellows():
    holes = [cylinder(3, 8, (x, y, 0.0)) for x in (-14.0, 14.0) for y in (-9.0, 9.0)]
    truth = cut(box(40, 30, 6), *holes)
    found = cut(box(40, 30, 6), *holes[:3], box(5.6, 5.8, 8, (14.1, 9.0, 0.0)))
    seen, frame = seen_of(mesh_of(truth))
    alike = frame.undo(fit_numbers(frame.apply(found), seen))
    assert list(leaves(snap_numbers(alike, seen, frame)))[4] == holes[3]


FUNNEL = cut(
    union(
        cone(7.45, 13.9, 10.0, (0, 0, 12.4)),
        cylinder(13.9, 10, (0, 0, 22.4)),
        cylinder(7.45, 13, (0, 0, 6.5)),
        cylinder(2.05, 27.4, (0, 8.25, 13.7)),
        cylinder(2.05, 27.4, (0, -8.25, 13.7)),
    ),
    cylinder(6.25, 13.2, (0, 0, 6.5)),
    cone(6.25, 12.7, 8.8, (0, 0, 13.6)),
    cylinder(12.7, 9.6, (0, 0, 22.8)),
)


def test_the_cones_that_a_stack_is_made_of_get_round_numbers_too():
    """Found as what a long cone and a cylinder have in common, of which neither has the length that is seen."""
    slope = 6.45 / 10.0
    long = cone(7.45 - 6.725 * slope, 13.9 + 10 * slope, 26.725, (0, 0, 14.0375))
    head = common(long, cylinder(13.9, 26.725, (0, 0, 14.0375)))
    _, _, *others = leaves(FUNNEL)
    found = cut(union(head, *others[:3]), *others[3:])
    parts = list(leaves(one_body._round(found, *seen_of(mesh_of(FUNNEL, 64)), NEVER, None)))
    assert cone(7.45, 13.9, 10.0, (0, 0, 12.4)) in parts
    assert cylinder(13.9, 10.0, (0, 0, 22.4)) in parts


def test_corners_on_chords_do_not_draw_numbers_inwards():
    """Where the pins cut the cone's facets, corners lie inside it, and a cone that is a little lower fits those better."""
    seen, _ = seen_of(mesh_of(FUNNEL, 64))
    walls = [patch for patch in seen.patches if patch.surface.kind == "cone"]
    told = [rounding._true_corners(patch) for patch in walls]
    assert any(len(few) < len(patch.points) for few, patch in zip(told, walls, strict=True))
    assert all(np.abs(signed_distance(w.surface, few)).max() <= rounding.ON_SURFACE for few, w in zip(told, walls, strict=True))
    assert next(leaves(rounded(FUNNEL, mesh_of(FUNNEL, 64)))).size == (7.45, 13.9, 10.0)


def counted(module, monkeypatch):
    """The solids of whose IoU a module asks from now on."""
    asked = []
    monkeypatch.setattr(module, "volume_iou", lambda a, b: asked.append((a, b)) or volume_iou(a, b))
    return asked


@pytest.mark.parametrize(("thickness", "times"), [(6 * (1 + 0.5 * SNAP_LOSS), 0), (6 * (1 + 1.4 * SNAP_LOSS), 3)])
def test_the_mesh_is_asked_only_where_more_changes_than_it_may_lose(thickness, times, monkeypatch):
    truth = cut(box(40, 30, 6), cylinder(3, 8))
    judge = judged(truth, truth)
    asked = counted(rounding, monkeypatch)
    assert judge.keeps(cut(box(40, 30, thickness), cylinder(3, 8)))
    assert len(asked) == times


def test_a_program_is_compared_with_the_mesh_once(monkeypatch):
    plate = box(40, 30, 6)
    seen, frame = seen_of(mesh_of(plate))
    asked = counted(observation, monkeypatch)
    assert seen.iou(frame.apply(plate)) == seen.iou(frame.apply(plate)) == pytest.approx(1.0)
    assert len(asked) == 1


def test_one_odd_wall_keeps_no_other_from_being_rounded():
    """A thin web between short flanges, at a place for which no rounder one will do: the flanges have lost their last bits all the same."""
    web = 0.501839
    walls = ((web, 0), (web + 2, 0), (web + 2, 0.5), (web + 1, 0.5), (web + 1, 59.5), (web + 1.97, 59.5), (web + 1.97, 60), (web, 60))
    off = ((3.2e-5, -2.9e-5) * 4)[: len(walls)]

    def channel(noise):
        loop = tuple((x, y + d * noise, 0.0) for (x, y), d in zip(walls, off, strict=True))
        return Primitive("extrude", (30.0,), (0.0, 0.0, 15.0), (0.0, 0.0, 0.0), Outline((loop,)))

    # what the program lacks of the mesh is more than rounding changes
    (found,) = leaves(rounded(channel(1.0), mesh_of(union(channel(0.0), box(0.2, 1.2, 1.2, (web, 30.0, 15.0))))))
    places = {round(found.center[1] + y, 9) for loop in found.outline.loops for _, y, _ in loop}
    assert places == {0.0, 0.5, 59.5, 60.0}


def test_a_part_that_lies_anywhere_has_round_sizes():
    """Walls of a thin box of 0.8 at no round place: each would be rounded, or stay, by itself."""
    at, walls = (-101.4371839, 57.0031417, 12.3456789), ((20, 14, 9), (18.4, 12.4, 9))
    moved = [
        box(*size, tuple(a + b for a, b in zip(at, middle, strict=True)))
        for size, middle in zip(walls, [(0, 0, 0), (0, 0, 0.8)], strict=True)
    ]
    mesh = mesh_of(cut(*moved))
    mesh.vertices = np.float32(mesh.vertices)
    off = [box(*(v + 3e-6 for v in leaf.size), tuple(c + 2e-6 for c in leaf.center)) for leaf in moved]
    outer, inner = leaves(rounded(cut(*off), mesh))
    assert outer.size == pytest.approx((20, 14, 9), abs=1e-9)
    assert inner.size[:2] == pytest.approx((18.4, 12.4), abs=1e-9)
    assert inner.center[:2] == outer.center[:2]
    assert outer.center == pytest.approx(at, abs=2e-5)


def test_copies_are_rounded_together():
    """A tray with numbers in thousandths, of which rounder ones of all its pockets cost more than they may: no single pocket has them."""
    pockets = [box(36.668, 17.4, 51.846, (39.068 * i, 19.8 * j, 1.6)) for i in (-1, 0, 1) for j in (-0.5, 0.5)]
    slots = [box(13.0227, 44.0, 17.682, (39.068 * i, 0.0, 17.682 * j)) for i in (-1, 0, 1) for j in (-1, 1)]
    tray = cut(box(119.604, 42.0, 53.046), *pockets, *slots)
    _, *found = leaves(rounded(tray, mesh_of(tray)))
    assert len({leaf.size for leaf in found[:6]}) == 1
    assert len({leaf.size for leaf in found[6:]}) == 1


def test_faces_of_one_plane_stay_in_it():
    """What is rounded in one box, and would cost too much in the other, too, is the same number again."""
    plain = union(box(33.0, 60.0, 13.0, (-357.278, 0.0, 0.0)), box(33.0, 4.7, 3.4, (-357.278, -20.0, 8.2)))
    rounding_ = rounding._Rounding(plain, lambda _: 0.0, judged(plain, plain), 1e-5, NEVER)
    wall, rim = leaves(plain)
    parted = union(wall, replace(rim, size=(33.002, 4.7, 3.4), center=(-357.279, -20.0, 8.2)))
    assert [leaf.size[0] for leaf in leaves(rounding_._rejoin(parted, 1.0, 1.0))] in ([33.0, 33.0], [33.002, 33.002])


def test_what_costs_hardly_more_is_kept_where_all_has_been_spent():
    truth = box(40, 30, 6)
    judge = judged(truth, truth)
    spent = judge.costs(box(40, 30, 6 * (1 + 4 * SNAP_LOSS)))
    assert spent.lost > judge.most_lost
    for more, kept in ((1e-6, True), (2e-5, False)):
        assert judge.seems_kept(box(40 * (1 + more), 30, 6 * (1 + 4 * SNAP_LOSS)), 1.0, spent) == kept


def judged(truth, plain):
    seen, frame = seen_of(mesh_of(truth))
    return rounding._SolidJudge(plain, seen, frame)


@pytest.mark.parametrize(
    ("thickness", "kept"), [(6 * (1 + 0.5 * SNAP_LOSS), True), (6 * (1 + 4 * SNAP_LOSS), False), (6 * (1 - SNAP_CHANGE), False)]
)
def test_points_and_booleans_say_the_same_of_a_plate(thickness, kept):
    truth = cut(box(40, 30, 6), cylinder(3, 8))
    judge = judged(truth, truth)
    trial = cut(box(40, 30, thickness), cylinder(3, 8))
    assert judge.seems_kept(trial, 1.0) == kept
    assert judge.keeps(trial) == kept
    assert not judge.seems_kept(trial, 4.0)


def test_what_booleans_refuse_is_tried_more_cautiously_and_then_left(monkeypatch):
    tried = []
    seems = rounding._SolidJudge.seems_kept
    monkeypatch.setattr(
        rounding._SolidJudge,
        "seems_kept",
        lambda judge, trial, caution, *spent: tried.append(caution) or seems(judge, trial, caution, *spent),
    )
    monkeypatch.setattr(rounding._SolidJudge, "keeps", lambda judge, trial: False)
    found = cut(box(40.0004, 29.9998, 6.0001), cylinder(3.0002, 8))
    plate, hole = leaves(rounded(found, mesh_of(cut(box(40, 30, 6), cylinder(3, 8)))))
    assert (plate, hole) == tuple(leaves(found))
    assert list(dict.fromkeys(tried)) == list(rounding.CAUTIONS)
