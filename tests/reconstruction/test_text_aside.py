"""Text is set aside before the search: the program has the plain face, its notes and the verdict say of which text."""

import numpy as np
import pytest
from manifold3d import Manifold
from tests.lettered import box, draw_text, raise_on, sink_into

from imdim.delivery.verdict import judge
from imdim.geometry.solid import mesh_to_manifold, symmetric_difference_volume, to_manifold, to_trimesh
from imdim.program.tree import leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct_best
from imdim.reconstruction.text_aside import set_text_aside
from imdim.target.target import Target, target_from

HOLES = [Manifold.cylinder(20, 3, 3, 96).translate((x, 0, -5)) for x in (-38, 38)]
PLATE = box(90, 40, 0, 8) - HOLES[0] - HOLES[1]
TURN = (20, 35, 50)


def target(solid: Manifold) -> Target:
    return target_from(to_trimesh(solid))


@pytest.mark.parametrize(("make", "how"), [(raise_on, "raised"), (sink_into, "sunk")])
def test_what_is_left_is_the_plain_part(make, how):
    bare = set_text_aside(target(make(PLATE, draw_text("LEFT HOLE", 7).translate((0, 4)), 8, 0.6)))
    assert symmetric_difference_volume(mesh_to_manifold(bare.target.mesh), PLATE) < 1e-9 * PLATE.volume()
    assert bare.notes == (
        f"text of 8 letters, {how} by 0.6 on the +z face at (0, 4, 8): set aside as decoration, the program has the plain face",
    )


def test_two_rows_over_two_faces_are_two_texts():
    both = raise_on(PLATE, draw_text("HELP", 6).translate((0, 7)) + draw_text("LEFT", 6).translate((0, -4)), 8, 0.5)
    both = sink_into(both.rotate((180, 0, 0)).translate((0, 0, 8)), draw_text("FLUTE"), 8, 0.5)
    bare = set_text_aside(target(both))
    assert sorted(note.split(" at ")[0] for note in bare.notes) == [
        "text of 5 letters, sunk by 0.5 on the +z face",
        "text of 8 letters in 2 rows, raised by 0.5 on the -z face",
    ]
    assert mesh_to_manifold(bare.target.mesh).volume() == pytest.approx(PLATE.volume(), rel=1e-9)


def test_text_that_a_part_is_made_of_stays():
    sign = target(raise_on(box(60, 16, 0, 2), draw_text("LEFTPE"), 2, 3))
    bare = set_text_aside(sign)
    assert bare.target is sign
    assert bare.notes[0].endswith("too much of the part to be set aside as decoration")


def test_what_has_no_text_or_no_inside_stays_as_it_is():
    plain = target(PLATE)
    assert set_text_aside(plain).target is plain
    cloud = target_from(np.random.default_rng(0).normal(size=(200, 3)))
    assert set_text_aside(cloud).target is cloud


@pytest.mark.parametrize("turn", [(0, 0, 0), TURN], ids=["as it is", "aslant"])
def test_the_program_has_the_plain_plate_and_the_verdict_its_text(turn):
    lettered = target(raise_on(PLATE, draw_text("LEFT HOLE", 7), 8, 0.6).rotate(turn))
    found = reconstruct_best(lettered, Settings(budget_s=40))
    assert sorted(part.kind for part in leaves(found.program)) == ["box", "cylinder", "cylinder"]
    (note,) = (note for note in found.notes if "text" in note)
    face = "+z face at (0, 0, 8)" if turn == (0, 0, 0) else "face towards ("
    assert note.startswith(f"text of 8 letters, raised by 0.6 on the {face}")
    verdict = judge(lettered, to_trimesh(to_manifold(found.program)))
    (region,) = verdict.regions
    assert (region.kind, region.verdict, verdict.overall) == ("text", "left out", "approximated")
    assert region.what.startswith("text or decoration, 8 pieces raised by 0.6")


def test_primitives_alone_set_nothing_aside():
    lettered = target(raise_on(PLATE, draw_text("HELP", 7), 8, 0.6))
    assert not any("text" in note for note in reconstruct_best(lettered, Settings(budget_s=5, language="csg")).notes)
