"""Faces that are clicked, what lies between them, and what can be asked of them."""

import math

import numpy as np
import pytest

from imdim.app.lab import drawing, edits
from imdim.app.lab.edits import ConstrainedProgram, LabEditError
from imdim.app.lab.examples import PROGRAMS
from imdim.app.lab.fitting_relations import find_fitting
from imdim.app.lab.measure import measure, name_pick
from imdim.app.lab.picks import is_same_face, pick_face
from imdim.app.lab.relation_words import say_relation
from imdim.geometry.edge_solids import solid_with_edges
from imdim.geometry.lowering import lower
from imdim.geometry.pose import Pose
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.constraints import Constraint, Ref
from imdim.program.edges import EdgeFeature, Face
from imdim.program.tree import Combine, Primitive, leaves
from imdim.relations.residuals import verify
from imdim.target.target import Frame, target_from

DOWN = np.array([0.0, 0.0, -1.0])
# a plate 80 x 50 x 8 about the origin, a boss of diameter 28 up to z = 20, four holes of diameter 6, and a bore of diameter 16 in the boss
PLATE, BOSS, HOLE, BORE = 0, 1, 2, 6
BRACKET = ConstrainedProgram(PROGRAMS["Bracket"]())


class Scene:
    """A program as it is drawn, into which rays are sent."""

    def __init__(self, theory):
        self.theory = theory
        self.frame = Frame.of(target_from(to_trimesh(solid_with_edges(theory.program, theory.edges)), "part"))
        self.drawn = drawing.scene(theory, self.frame, None)

    def pick(self, origin, direction, leaf=-1):
        start = drawing.place(self.frame, np.array([origin], float))[0].astype(float)
        return pick_face(self.theory, self.drawn, self.frame, leaf, start, np.array(direction, float))

    def measured(self, *picks):
        return measure(picks, Pose.of(lower(self.theory.program)), "mm")

    def offered(self, *picks):
        labels, parts = self.theory.labels, list(leaves(self.theory.program))
        return {say_relation(one.constraint, labels, parts, "mm"): one for one in find_fitting(picks, self.theory)}


@pytest.fixture(scope="module")
def bracket():
    return Scene(BRACKET)


def test_a_ray_meets_the_face_before_it(bracket):
    top = bracket.pick((20, 5, 50), DOWN)
    assert (top.leaf, top.face) == (PLATE, Ref(PLATE, "+z"))
    assert top.point == pytest.approx([20, 5, 4], abs=1e-5)
    assert top.normal == pytest.approx([0, 0, 1])
    side = bracket.pick((100, 1, 0), (-1, 0, 0))
    assert side.face == Ref(PLATE, "+x")
    wall = bracket.pick((100, 0, 12), (-1, 0, 0))
    assert (wall.leaf, wall.face, wall.radius) == (BOSS, None, 14.0)
    assert bracket.pick((100, 0, 50), (-1, 0, 0)) is None, "it goes over the part"
    assert name_pick(top, BRACKET).startswith("the top face of ")
    assert is_same_face(top, bracket.pick((-20, 5, 50), DOWN))
    assert not is_same_face(top, side)


def test_what_is_picked_is_lit_as_a_whole(bracket):
    top = bracket.pick((20, 5, 50), DOWN)
    a, b, c = np.moveaxis(top.triangles / drawing.SPAN / bracket.frame.scale, 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert area == pytest.approx(80 * 50 - math.pi * (14**2 + 4 * 3**2), rel=1e-3)


def test_behind_a_translucent_cutter_its_own_wall_is_picked(bracket):
    wall = bracket.pick((30, 17, 6), (0.5, 0, -1), HOLE + 3)
    assert (wall.leaf, wall.radius) == (HOLE + 3, 3.0)
    assert wall.center[:2] == pytest.approx([30, 17])
    through = bracket.pick((30, 17, 50), DOWN, HOLE + 3)
    assert is_same_face(wall, through), "a hole is clicked where it is seen through"


def test_distances_angles_and_diameters(bracket):
    top, bottom = bracket.pick((20, 5, 50), DOWN), bracket.pick((20, 5, -50), -DOWN)
    left, wall = bracket.pick((-100, 1, 0), (1, 0, 0)), bracket.pick((100, 0, 12), (-1, 0, 0))
    holes = [bracket.pick((x, y, 50), DOWN, leaf) for leaf, x, y in ((HOLE, -30, -17), (HOLE + 3, 30, 17))]
    assert bracket.measured(top).lines[0] == "flat, at z = 4 mm"
    assert bracket.measured(wall).lines[0] == "diameter 28 mm"
    between = bracket.measured(top, bottom)
    assert between.lines == ("distance 8 mm, parallel",)
    assert between.ends == pytest.approx(np.array([[20, 5, 4], [20, 5, -4]]), abs=1e-4)
    assert bracket.measured(top, left).lines[0] == "angle 90°"
    assert bracket.measured(left, wall).lines == ("axis 40 mm from the face",)
    assert bracket.measured(wall, top).lines == ("angle between axis and face 90°",)
    apart = bracket.measured(*holes)
    assert apart.lines[0] == f"axes {math.hypot(60, 34):.3f} mm apart"
    assert apart.lines[1:] == ("x 60 mm, y 34 mm", "diameters 6 mm and 6 mm")


def test_relations_that_fit_are_said_in_words_and_hold_once_they_are_chosen(bracket):
    one, two = (bracket.pick((x, y, 50), DOWN, leaf) for leaf, x, y in ((HOLE, -30, -17), (HOLE + 3, 30, 17)))
    offered = bracket.offered(one, two)
    equal = next(found for words, found in offered.items() if "equal diameter" in words)
    assert equal.holds
    apart = next(found for words, found in offered.items() if "60 mm apart along the x axis" in words)
    assert apart.constraint == Constraint("aligned", (Ref(HOLE), Ref(HOLE + 3)), Ref(-1, "x"), 60.0)
    level = next(found for words, found in offered.items() if "level along the x axis" in words)
    assert not level.holds
    theory = edits.with_constraint(BRACKET, level.constraint)
    x = [part.center[0] for part in leaves(theory.program)]
    assert (x[HOLE], x[HOLE + 3]) == (-30.0, pytest.approx(-30.0)), "the second comes to the first"
    assert [part.size for part in leaves(theory.program)] == [part.size for part in leaves(BRACKET.program)]
    known = find_fitting((one, two), edits.with_constraint(BRACKET, apart.constraint))
    assert [found.is_there for found in known if found.constraint == apart.constraint] == [0]


def test_a_wall_is_made_tangent_to_a_face_and_to_another_wall(bracket):
    right, top, boss = bracket.pick((100, 1, 0), (-1, 0, 0)), bracket.pick((20, 5, 50), DOWN), bracket.pick((100, 0, 12), (-1, 0, 0))
    hole = bracket.pick((30, 17, 50), DOWN, HOLE + 3)
    assert not any("tangent" in words for words in bracket.offered(top, boss)), "the boss stands on that face"
    along = next(found for words, found in bracket.offered(right, boss).items() if "is tangent to the right face of" in words)
    assert not along.holds
    verify(edits.with_constraint(BRACKET, along.constraint).program, [along.constraint])
    beside = next(found for words, found in bracket.offered(boss, hole).items() if "is tangent to" in words)
    program = list(leaves(edits.with_constraint(BRACKET, beside.constraint).program))
    apart = math.dist(program[BOSS].center[:2], program[HOLE + 3].center[:2])
    assert apart == pytest.approx(program[BOSS].size[0] + program[HOLE + 3].size[0])


def test_of_two_plane_faces_and_of_a_face_and_an_axis(bracket):
    right, wall = bracket.pick((100, 1, 0), (-1, 0, 0)), bracket.pick((100, 0, 12), (-1, 0, 0))
    assert any("40 mm apart" in words for words in bracket.offered(right, wall))
    top, rim = bracket.pick((20, 5, 50), DOWN), bracket.pick((11, 0, 50), DOWN)
    words = bracket.offered(top, rim)
    assert any(one.endswith("are flush") for one in words)
    assert any(one.endswith("are 16 mm apart") and found.holds for one, found in words.items())
    holes = [bracket.pick((x, y, 50), DOWN, HOLE + i) for i, (x, y) in enumerate(((-30, -17), (-30, 17), (30, -17)))]
    assert any("midway" in one for one in bracket.offered(*holes))
    (kept,) = bracket.offered(wall)
    assert kept.startswith("diameter of ")
    assert kept.endswith(" is 28 mm")


def test_a_distance_is_set_and_what_cannot_hold_is_refused_in_words():
    apart = Constraint("aligned", (Ref(HOLE), Ref(HOLE + 2)), Ref(-1, "x"), 60.0)
    theory = edits.with_constraint(BRACKET, apart)
    wider = edits.with_amount(theory, 0, 50.0)
    x = [part.center[0] for part in leaves(wider.program)]
    assert x[HOLE + 2] - x[HOLE] == pytest.approx(50.0)
    diameter = edits.with_constraint(BRACKET, Constraint("value", (Ref(BOSS, "r"),), value=14.0))
    assert edits.amount_of(diameter.constraints[0]) == 28.0
    assert list(leaves(edits.with_amount(diameter, 0, 30.0).program))[BOSS].size[0] == pytest.approx(15.0)
    with pytest.raises(LabEditError, match="cannot hold beside the other relations"):
        edits.with_constraint(theory, Constraint("aligned", apart.of, apart.about, 40.0))
    with pytest.raises(LabEditError, match="click one in the list"):
        edits.with_amount(edits.with_constraint(BRACKET, Constraint("parallel", (Ref(BOSS, "z"), Ref(BORE, "z")))), 0, 3.0)


def test_an_arc_of_a_drawing_has_its_own_radius_and_a_line_none():
    lever = Scene(ConstrainedProgram(PROGRAMS["Lever"]()))
    end = lever.pick((200, 0, 0), (-1, 0, 0))
    assert end.radius == pytest.approx(10.0)
    assert end.center[:2] == pytest.approx([60, 0], abs=1e-6)
    flank = lever.pick((30, 100, 0), (0, -1, 0))
    assert flank.is_flat
    assert flank.face is None
    hub = lever.pick((-100, 0, 12), (1, 0, 0))
    assert lever.measured(hub, end).lines[:1] == ("axes 60 mm apart",)
    assert not any("share one axis" in words for words in lever.offered(hub, end)), "the drawing's centre is none of its arcs'"


def test_a_fillet_is_picked_as_itself():
    block = Primitive("box", (40.0, 30.0, 10.0))
    edges = (EdgeFeature("fillet", (3.0,), ((Face(0, "+z"), Face(0, "+x")),)),)
    scene = Scene(ConstrainedProgram(block, edges=edges))
    found = scene.pick((100, 0, 4.2), (-1, 0, 0))
    assert found.leaf == 1
    assert "fillet" in name_pick(found, scene.theory)
    assert scene.offered(found) == {}


def test_a_tilted_box_has_its_faces():
    tilted = Primitive("box", (20.0, 20.0, 20.0), rotation=(0.0, 30.0, 0.0))
    scene = Scene(ConstrainedProgram(Combine("union", Primitive("box", (60.0, 60.0, 4.0), (0.0, 0.0, -20.0)), tilted)))
    slope, plate = scene.pick((3, 0, 50), DOWN), scene.pick((29, 0, 50), DOWN)
    assert slope.face is not None
    assert scene.measured(slope, plate).lines[0] in ("angle 30°", "angle 60°")
    assert "face of" in name_pick(slope, scene.theory)
    assert to_manifold(scene.theory.program).volume() > 0
