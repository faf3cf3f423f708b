"""Features are measured from where a person measures them, and an edit moves what stands on the datum."""

import pytest
from tests.planted import box, cone, cut, cylinder

from imdim.delivery.finish import finish
from imdim.export.openscad import to_openscad
from imdim.export.openscad_reader import read_openscad
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.outline import Outline
from imdim.program.tree import FULL_TURN, Primitive, Program, combine_all
from imdim.relations.discover import exact_relations


def join(*terms: Program) -> Program:
    return combine_all("union", list(terms))


class Edited:
    """A program as it is delivered, and what its text says with some names at other values."""

    def __init__(self, program: Program) -> None:
        exact = exact_relations(program)
        found = finish(exact.program, exact.constraints)
        self.values = found.parameters.values
        self._text = to_openscad(found.program, 96, found.parameters)
        assert self.is_now(program)

    def is_now(self, program: Program, **values: float) -> bool:
        """Whether the solid is that of `program` then."""
        assert values.keys() <= self.values.keys()
        return volume_iou(to_manifold(read_openscad(self._text, values), 96), to_manifold(program, 96)) > 1 - 1e-6


def tray(length: float = 100.0, wall: float = 3.0, floor: float = 4.0, inset: float = 8.0, height: float = 24.0) -> Program:
    inner = (length - 2 * wall, 60.0 - 2 * wall)
    pocket = box(*inner, height - floor, (0.0, 0.0, (height + floor) / 2))
    x, y = inner[0] / 2 - inset, inner[1] / 2 - inset
    posts = [cylinder(4.0, 14.0, (a * x, b * y, 7.0)) for a in (-1, 1) for b in (-1, 1)]
    return join(cut(box(length, 60.0, height, (0.0, 0.0, height / 2)), pocket), *posts)


def test_a_tray_has_a_wall_a_floor_and_posts_at_its_corners() -> None:
    edited = Edited(tray())
    assert edited.values.items() >= {"body_wall": 3.0, "body_floor": 4.0, "boss_inset": 8.0}.items()
    assert edited.is_now(tray(length=120.0), body_length=120.0)
    assert edited.is_now(tray(wall=4.0), body_wall=4.0)
    assert edited.is_now(tray(floor=5.0), body_floor=5.0)
    assert edited.is_now(tray(inset=10.0), boss_inset=10.0)
    assert edited.is_now(tray(height=30.0), body_height=30.0)


def frame(plate: float = 12.0, length: float = 138.0) -> Program:
    """A frame about its middle with a plate at the wall in each corner, which holds a hole."""
    body = cut(box(length, 78.0, 6.0, (0.0, 0.0, 3.0)), box(length - 4.0, 74.0, 6.0, (0.0, 0.0, 3.0)))
    x = (length - 4.0) / 2 - plate / 2
    places = [(a * x, b * 12.5) for a in (-1, 1) for b in (-1, 1)]
    plates = [box(plate, 12.0, 2.0, (*at, 1.0)) for at in places]
    return cut(join(body, *plates), *(cylinder(1.2, 2.0, (*at, 1.0)) for at in places))


def test_plates_at_a_wall_grow_from_it_and_the_frame_stays() -> None:
    edited = Edited(frame())
    assert edited.values["plate_wall"] == 2
    assert edited.is_now(frame(plate=14.0), block_length=14.0)
    assert edited.is_now(frame(length=150.0), plate_length=150.0)


def cornered(length: float = 100.0, pocket: float = 12.0, size: float = 30.0, first: float = 15.0, pitch: float = 16.0) -> Program:
    """A plate from its corner, with a pocket so far from its left edge, and two holes a pitch apart so far from the right one."""
    plate = box(length, 60.0, 12.0, (length / 2, 30.0, 6.0))
    recess = box(size, 20.0, 5.0, (pocket + size / 2, 20.0, 9.5))
    return cut(plate, recess, *(cylinder(3.0, 12.0, (length - first - k * pitch, 45.0, 6.0)) for k in (0, 1)))


def test_what_lies_near_an_edge_is_measured_from_that_edge() -> None:
    edited = Edited(cornered())
    assert (
        edited.values.items() >= {"pocket_from_left": 12.0, "hole_from_right": 15.0, "hole_from_back": 15.0, "hole_spacing": 16.0}.items()
    )
    assert edited.is_now(cornered(pocket=14.0), pocket_from_left=14.0)
    assert edited.is_now(cornered(size=34.0), pocket_length=34.0)
    assert edited.is_now(cornered(first=18.0), hole_from_right=18.0)
    assert edited.is_now(cornered(pitch=20.0), hole_spacing=20.0)
    assert edited.is_now(cornered(length=120.0), plate_length=120.0)


def wall(height: float = 60.0, hole: float = 42.0, apart: float = 30.0) -> Program:
    """A foot with two holes, the same way from its middle, and a wall on its back edge with a hole above the base."""
    foot, back = box(60.0, 50.0, 6.0, (0.0, -25.0, 3.0)), box(60.0, 9.0, height, (0.0, -4.5, height / 2))
    bore = cylinder(5.0, 9.0, (0.0, -4.5, hole), (90.0, 0.0, 0.0))
    return cut(join(back, foot), *(cylinder(3.0, 6.0, (x, -38.0, 3.0)) for x in (-apart / 2, apart / 2)), bore)


def test_heights_are_above_the_base_and_pairs_have_a_spacing() -> None:
    edited = Edited(wall())
    assert edited.is_now(wall(height=70.0), **{next(n for n, v in edited.values.items() if v == 60.0 and n.endswith("height")): 70.0})
    assert edited.is_now(wall(hole=35.0), **{next(n for n in edited.values if n.endswith("from_bottom")): 35.0})
    assert edited.is_now(wall(apart=36.0), hole_spacing=36.0)


@pytest.mark.parametrize(("gap", "named"), [(4.0, True), (25.0, False)])
def test_a_thick_wall_is_what_its_pocket_leaves(gap: float, named: bool) -> None:
    program = cut(box(100.0, 60.0, 20.0), box(100.0 - 2 * gap, 60.0 - 2 * gap, 20.0, (0.0, 0.0, 0.0)))
    assert ("plate_wall" in Edited(program).values) == named


def knob(plate: float = 8.0, height: float = 30.0) -> Program:
    """A turned boss on a plate, and a nipple in its side."""
    profile = ((8.0, 0.0), (20.0, 0.0), (16.0, height), (8.0, height))
    boss = Primitive("revolve", (FULL_TURN,), (0.0, 0.0, plate), outline=Outline((tuple((r, z, 0.0) for r, z in profile),)))
    return join(box(100.0, 60.0, plate, (0.0, 0.0, plate / 2)), boss, Primitive("sphere", (5.0,), (18.0, 0.0, plate + 14.0)))


def test_what_sits_in_the_side_of_a_turned_part_stays_at_its_height() -> None:
    edited = Edited(knob())
    assert edited.is_now(knob(plate=12.0), plate_thickness=12.0)


def rack(bar: float = 2.0, long: float = 2.0) -> Program:
    """Two long bars, and two short ones that cross their ends."""
    first, last = (box(long, 50.0, 11.0, (x, 0.0, 5.5)) for x in (15.0, -15.0))
    return join(first, *(box(30.0, bar, 11.0, (0.0, y, 5.5)) for y in (-25.0, 25.0)), last)


def test_a_bar_that_crosses_an_end_does_not_stand_on_it() -> None:
    edited = Edited(rack())
    bars = {name for name, value in edited.values.items() if value == 2.0}
    assert bars == {"plate_thickness", "block_width"}, "the second long bar is as thick as the first"
    assert edited.is_now(rack(bar=3.0), block_width=3.0)
    assert edited.is_now(rack(long=4.0), plate_thickness=4.0)


def sleeve(height: float = 20.0, shaft: float = 80.0) -> Program:
    """A shaft with a boss on its end, and a bore from end to end that is wider at first."""
    boss = cylinder(16.0, height + 1.0, (0.0, 0.0, shaft + height / 2 - 0.5))
    body = join(cylinder(20.0, shaft, (0.0, 0.0, shaft / 2)), boss)
    top = shaft + height
    return cut(body, cylinder(12.0, top, (0.0, 0.0, top / 2)), cylinder(15.0, 20.0, (0.0, 0.0, 10.0)))


def test_a_boss_carries_its_bore_and_does_not_end_where_that_does() -> None:
    edited = Edited(sleeve())
    assert edited.values["boss_height"] == 20.0
    assert 100.0 not in edited.values.values(), "the bore goes through, and has no length"
    assert edited.is_now(sleeve(height=30.0), boss_height=30.0)
    assert edited.is_now(sleeve(shaft=90.0), shaft_height=90.0)


def test_the_points_of_equal_cones_have_no_name() -> None:
    posts = [(x, y) for x in (-15.0, 15.0) for y in (-25.0, 25.0)]
    tipped = [part for x, y in posts for part in (cylinder(2.5, 15.0, (x, y, 7.5)), cone(2.7, 0.0, 3.75, (x, y, 16.875)))]
    edited = Edited(join(box(40.0, 60.0, 4.0, (0.0, 0.0, 2.0)), *tipped))
    assert all(edited.values.values())


def clip(reach: float = 38.0) -> Program:
    """A ring with an ear that begins in its bore, and a hole through that, 8 from its end."""
    ear = box(reach - 16.0, 10.0, 20.0, ((reach + 16.0) / 2, 0.0, 0.0))
    across = cylinder(2.6, 12.0, (reach - 8.0, 0.0, 0.0), (90.0, 0.0, 0.0))
    return cut(join(cylinder(20.0, 20.0), ear), cylinder(16.0, 22.0), across)


def test_an_ear_whose_foot_is_hidden_in_a_ring_reaches_so_far_from_its_middle() -> None:
    assert Edited(clip()).is_now(clip(reach=41.0), block_x=41.0)


def lug(length: float = 65.0, depth: float = 29.25) -> Program:
    """Drilled from both ends, with a wall between, and through its foot on either side."""
    drills = [Primitive("cylinder", (2.75, depth), (0.0, s * (length - depth) / 2, 0.0), (90.0, 0.0, 0.0)) for s in (1, -1)]
    feet = [Primitive("cylinder", (3.25, 14.0), (0.0, s * 18.5, -10.0)) for s in (1, -1)]
    return cut(box(24.5, length, 27.0), *drills, *feet)


def test_holes_that_meet_head_on_have_a_depth_and_no_distance() -> None:
    part = Edited(lug())
    assert not [value for value in part.values.values() if value == pytest.approx(65.0 - 29.25)]
    (depth,) = (name for name, value in part.values.items() if value == pytest.approx(29.25))
    assert depth.endswith("depth")
    (length,) = (name for name, value in part.values.items() if value == pytest.approx(65.0))
    assert part.is_now(lug(length=71.5), **{length: 71.5})
    assert part.is_now(lug(depth=25.0), **{depth: 25.0})
