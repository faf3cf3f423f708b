"""Holes in documents: what they say, and what is refused."""

import json

import pytest

from imdim.export.hole_names import hole_features
from imdim.program import codec
from imdim.program.hole_codec import HoleFeature, find_stale
from imdim.program.tree import Combine, Primitive, Program


def plate() -> Program:
    """Two counterbored holes for M3, and a blind one."""
    program: Program = Primitive("box", (80.0, 50.0, 10.0))
    for x in (-25.0, 25.0):
        bore, head = Primitive("cylinder", (1.7, 12.0), (x, 0.0, 0.0)), Primitive("cylinder", (3.25, 4.0), (x, 0.0, 4.0))
        program = Combine("difference", program, Combine("union", bore, head))
    return Combine("difference", program, Primitive("cylinder", (4.0, 8.0), (0.0, 0.0, 3.0)))


HOLES = (
    HoleFeature("counterbore", 3.4, "through", 2, (1, 2, 3, 4), (6.5, 3.0), "M3 clearance", "50 apart"),
    HoleFeature("blind", 8.0, 6.0, 1, (5,)),
)


def test_holes_of_a_program_are_what_was_drilled():
    assert hole_features(plate()) == HOLES


def test_documents_with_holes_come_back_as_they_were():
    text = codec.dumps(plate(), holes=HOLES)
    document = codec.parse(text)
    assert json.loads(text)["version"] == codec.HOLES
    assert codec.holes_of(document) == HOLES
    assert codec.dumps(codec.from_json(document), holes=codec.holes_of(document)) == text
    assert not codec.holes_of(codec.parse(codec.dumps(plate())))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"depth": -1.0}, "positive sizes"),
        ({"depth": "deep"}, "$.holes[0].depth"),
        ({"kind": "slot"}, "$.holes[0].kind"),
        ({"of": [6]}, "numbers of the 6 primitives"),
        ({"of": [True]}, "numbers of the 6 primitives"),
        ({"count": 0}, "$.holes[0].count"),
        ({"head_depth": None}, "$.holes[0].head_depth"),
        ({"radius": 3}, "radius"),
    ],
)
def test_what_is_no_hole_is_refused_in_one_line(change, said):
    document = json.loads(codec.dumps(plate(), holes=HOLES))
    document["holes"][0].update(change)
    with pytest.raises(ValueError, match=r"^[^\n]*$") as error:
        codec.from_json(document)
    assert said in str(error.value)


def test_older_versions_have_none():
    document = json.loads(codec.dumps(plate(), holes=HOLES))
    document["version"] = 5
    with pytest.raises(ValueError, match="came with version 6"):
        codec.from_json(document)


def test_holes_that_primitives_do_not_make_are_found():
    assert find_stale(HOLES, hole_features(plate())) is None
    assert find_stale((HOLES[0], HoleFeature("blind", 9.0, 6.0, 1, (5,))), HOLES) == 1
    assert find_stale((*HOLES, HOLES[1]), HOLES) == 2
