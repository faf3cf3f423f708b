import math

import numpy as np
import pytest
import trimesh
from tests.known_programs import KNOWN

from imdim.geometry.census import census_of
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.solid import (
    SEGMENTS,
    join_touching,
    mesh_to_manifold,
    symmetric_difference_volume,
    to_manifold,
    to_trimesh,
    volume,
    volume_iou,
    without_slivers,
)
from imdim.program.outline import Outline, circle, rectangle
from imdim.program.tree import Combine, Primitive, combine_all
from imdim.target.target import Frame, as_matrix

ROUND = {
    "sphere": (Primitive("sphere", (0.7,)), 4 / 3 * math.pi * 0.343),
    "cylinder": (Primitive("cylinder", (0.5, 2.0)), math.pi * 0.5),
    "torus": (Primitive("torus", (1.0, 0.3)), 2 * math.pi**2 * 0.09),
}


@pytest.mark.parametrize("name", KNOWN)
def test_known_volumes(name):
    program, exact = KNOWN[name]
    assert volume(program, 256) == pytest.approx(exact, rel=1e-3, abs=1e-12)


@pytest.mark.parametrize("name", ROUND)
def test_inscribed_solids_lack_volume_with_the_square_of_the_segments(name):
    program, exact = ROUND[name]
    coarse, fine = (1 - volume(program, n) / exact for n in (64, 128))
    assert coarse > 0
    assert coarse / fine == pytest.approx(4, rel=0.01)


def test_a_right_angle_is_exact():
    solid = to_manifold(Primitive("box", (1.0, 2.0, 3.0), rotation=(90.0, 0.0, 90.0)))
    assert solid.bounding_box() == (-1.5, -0.5, -1.0, 1.5, 0.5, 1.0)


def test_iou_of_boxes_that_share_half():
    a, b = (to_manifold(Primitive("box", (2.0, 1.0, 1.0), (x, 0.0, 0.0))) for x in (0.0, 1.0))
    assert volume_iou(a, b) == pytest.approx(1 / 3)
    assert volume_iou(a, a) == 1
    assert volume_iou(a, b.translate((5.0, 0.0, 0.0))) == 0


def test_what_solids_differ_by_is_what_one_of_them_holds():
    a, b = (to_manifold(Primitive("box", (2.0, 2.0, 2.0), (x, 0.0, 0.0))) for x in (0.0, 0.5))
    assert symmetric_difference_volume(a, b) == pytest.approx(2 * 0.5 * 4)
    assert symmetric_difference_volume(a, a) == pytest.approx(0.0, abs=1e-12)
    assert symmetric_difference_volume(a, to_manifold(Primitive("box", (2.0, 2.0, 2.0), (9.0, 0.0, 0.0)))) == pytest.approx(16)


@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e6)])
def test_a_soup_of_triangles_is_merged(scale, offset):
    ball = trimesh.creation.icosphere(subdivisions=2)
    corners = ball.vertices[ball.faces].reshape(-1, 3) * scale + offset
    soup = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    assert mesh_to_manifold(soup).volume() == pytest.approx(ball.volume * scale**3, rel=1e-8)


def test_corners_a_rounding_apart_are_merged():
    box = trimesh.creation.box()
    corners = box.vertices[box.faces].reshape(-1, 3) + np.random.default_rng(0).uniform(-1e-8, 1e-8, (36, 3))
    soup = trimesh.Trimesh(corners, np.arange(36).reshape(-1, 3), process=False)
    assert mesh_to_manifold(soup).volume() == pytest.approx(1, abs=1e-6)


def test_what_bounds_no_solid_is_refused():
    box = trimesh.creation.box()
    inverted = trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False)
    hole = trimesh.Trimesh(box.vertices, box.faces[1:], process=False)
    nan = trimesh.Trimesh(np.where(box.vertices > 0, np.nan, box.vertices), box.faces, process=False)
    for mesh, message in ((inverted, "encloses no volume: -1"), (hole, "11 faces is not a closed manifold"), (nan, "not finite")):
        with pytest.raises(ValueError, match=message):
            mesh_to_manifold(mesh)


def test_the_surface_comes_back_closed():
    program, exact = KNOWN["plate with boss and holes"]
    surface = to_trimesh(to_manifold(program, 256))
    assert surface.is_watertight
    assert surface.volume == pytest.approx(exact, rel=1e-3)
    assert volume_iou(mesh_to_manifold(surface), to_manifold(program, 256)) == pytest.approx(1, abs=1e-12)


def test_a_program_that_was_just_made_is_not_made_again():
    def bored() -> Combine:
        return Combine("difference", Primitive("sphere", (1.0,)), Primitive("cylinder", (0.5, 3.0)))

    made = to_manifold(bored())
    for size in range(1, 60):  # primitives take nobody's place
        to_manifold(Primitive("box", (1.0 * size, 1.0, 1.0)))
    assert to_manifold(bored(), SEGMENTS) is made
    assert to_manifold(bored(), 24).num_tri() < made.num_tri()


@pytest.mark.parametrize("scale", [1.0, 10.0, 1000.0])
def test_what_touches_but_for_the_noise_of_floats_is_one_body(scale):
    """Written as 4.4 - 0.9, a face is not quite where 3.5 is; sections keep 27 bits behind the point besides."""
    block = Primitive("box", (10 * scale, 7 * scale, 5 * scale))
    drawn = tuple((x * scale, y * scale, 0.0) for x, y in ((-3.0, -0.9), (3.0, -0.9), (2.0, 0.9), (-2.0, 0.9)))
    tab = Primitive("extrude", (5 * scale,), (0.0, 4.4 * scale, 0.0), outline=Outline((drawn,)))
    assert len(join_touching(Combine("union", block, tab)).decompose()) == 1
    assert join_touching(tab).volume() == pytest.approx(45 * scale**3, rel=1e-12)


@pytest.mark.parametrize("angle", [0.0, 5.0, 33.7])
def test_a_disc_in_a_bore_of_its_own_size_touches_it_all_around(angle: float) -> None:
    """Its corners are those of the bore but for the digits of floats, which a grid alone rounds apart here and there: holes no wider than
    that ran through between the two, and aslant the two were apart."""
    bored = Primitive("extrude", (20.0,), (0.1, 0.3, 0.7), outline=Outline((*rectangle(40.0, 30.0).loops, circle(7.1, 2.3, 1.9))))
    disc = Primitive("cylinder", (7.1, 2.0), (2.4, 2.2, 0.7))
    program = Frame((0.0, 0.0, 0.0), 1.0, as_matrix(matrix_from_euler((0.0, 0.0, angle)))).undo(Combine("union", bored, disc))
    assert census_of(join_touching(program)).kind == (1, 0, 0)


# a plate, a wall that begins where it ends up to rounding, and a block through both
STACK = combine_all(
    "union",
    [
        Primitive("box", (30.0, 20.5, 30.0), (15.0, 14.45, 15.0)),
        Primitive("box", (30.0, 5.3, 30.0), (15.0, 27.35, 15.0)),
        Primitive("box", (10.0, 6.0, 6.0), (15.0, 24.0, 17.0)),
    ],
)


def test_slivers_are_left_where_a_wall_would_go_with_them():
    solid = to_manifold(STACK)
    assert without_slivers(solid, 1e-6).volume() == pytest.approx(30 * 25.8 * 30)
    assert solid.simplify(1e-6).volume() < 18_000  # else this is needed no more


def test_edges_shorter_than_a_tolerance_go():
    block = Primitive(
        "extrude", (1.0,), outline=Outline((((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1e-7, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)),))
    )
    solid = to_manifold(block)
    assert without_slivers(solid, 1e-6).num_tri() == 12 < solid.num_tri()
