"""Features that are equal all over share one name for how deep or how high they are."""

from imdim.delivery.finish import finish
from imdim.export.twins import find_twins
from imdim.program.constraints import Constraint, Ref
from imdim.program.tree import Combine, Primitive, combine_all
from imdim.reconstruction.fitting import relations_of

BAR = Primitive("cylinder", (5.0, 260.0), (0.0, 0.0, 33.0), (0.0, 90.0, 0.0))
POSTS = [Primitive("cylinder", (6.0, 33.0), (x, 0.0, 16.5)) for x in (98.0, -98.0)]


def name_handle(*depths: float) -> dict[str, float]:
    """The names of a bar on two posts with a blind hole each, where no relation says that these end in one plane."""
    holes = [Primitive("cylinder", (1.4, d + 1.0), (p.center[0], 0.0, (d - 1.0) / 2)) for d, p in zip(depths, POSTS, strict=True)]
    program, constraints = relations_of(combine_all("difference", [combine_all("union", [BAR, *POSTS]), *holes]))
    return finish(program, [c for c in constraints if c.kind != "coplanar" or c.of[0].leaf < 3]).parameters.values


def test_two_equal_blind_holes_have_one_depth() -> None:
    values = name_handle(7.5, 7.5)
    assert [name for name in values if "hole" in name and "depth" in name] == ["hole_depth"]


def test_holes_of_other_depths_have_their_own() -> None:
    values = name_handle(7.5, 9.0)
    assert sorted(value for name, value in values.items() if "depth" in name) == [7.5, 9.0]


def test_twins_are_tied_and_as_large_along_all_axes() -> None:
    parts = [Primitive("cylinder", (2.0, h)) for h in (5.0, 5.0, 6.0, 5.0)]
    tied = Constraint("equal", tuple(Ref(i, "r") for i in (0, 1, 2)))
    found = find_twins([tied], parts, 1e-6)
    assert found[0] == found[1]
    assert found[2] != found[0]
    assert 3 not in found


def test_what_is_as_far_off_all_around_has_one_gap() -> None:
    ring = Combine("difference", Primitive("box", (12.0, 12.0, 2.0)), Primitive("box", (11.0, 11.0, 4.0)))
    part = combine_all("union", [Primitive("box", (10.0, 10.0, 2.0)), ring])
    values = finish(*relations_of(part)).parameters.values
    assert [value for name, value in values.items() if "gap" in name] == [0.5]
