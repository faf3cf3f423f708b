"""Edge features in program documents: written, read, checked against the schema, and refused in one line."""

import json
from dataclasses import replace

import jsonschema
import pytest
from scripts.make_schema import schema

from imdim.program.codec import constraints_of, dumps, edges_of, from_json, to_json
from imdim.program.constraints import Constraint, Ref
from imdim.program.edges import EdgeFeature, Face, check_edges, describe_edges, faces_of, name_edges, read_face, scale_edges, with_sizes
from imdim.program.outline import Outline
from imdim.program.tree import Combine, Primitive

PLATE = Primitive("extrude", (4.0,), outline=Outline((((0.0, 0.0, 0.0), (9.0, 0.0, 0.0), (0.0, 6.0, 0.0)),)))
PROGRAM = Combine("difference", PLATE, Primitive("cylinder", (1.0, 8.0), (2.0, 2.0, 0.0)))
MOUTH = EdgeFeature("chamfer", (0.5, 0.25), ((Face(0, "+z"), Face(1, "side")),))
RIM = EdgeFeature("fillet", (1.0,), ((Face(0, "+z"), Face(0, "wall[0][0]")), (Face(0, "+z"), Face(0, "wall[0][2]"))), "lip")


def document(**changes: object) -> dict[str, object]:
    edge = {"kind": "fillet", "radius": 1.0, "edges": [["0.+z", "0.wall[0][0]"]]} | changes
    return {**to_json(PROGRAM), "version": 5, "edges": [{k: v for k, v in edge.items() if v is not None}]}


def test_what_is_written_is_read_and_the_schema_agrees() -> None:
    tied = (Constraint("value", (Ref(1, "r"),), value=1.0),)
    text = dumps(PROGRAM, constraints=tied, edges=(RIM, MOUTH))
    parsed = json.loads(text)
    jsonschema.Draft202012Validator(schema()).validate(parsed)
    assert parsed["version"] == 5
    assert parsed["edges"][1] == {"kind": "chamfer", "distance": 0.5, "second": 0.25, "edges": [["0.+z", "1.side"]]}
    assert (from_json(parsed), edges_of(parsed), constraints_of(parsed)) == (PROGRAM, (RIM, MOUTH), tied)
    assert edges_of(to_json(PROGRAM)) == ()


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"radius": 0}, "$.edges[0]: a fillet needs a positive radius, got 0.0"),
        ({"radius": None}, "radius"),
        ({"name": "a b"}, "$.edges[0].name: expected a name of letters"),
        ({"second": 1}, "second"),
        ({"kind": "round"}, "$.edges[0].kind"),
        ({"edges": []}, "$.edges[0].edges: expected a list of 1 to"),
        ({"edges": [["0.+z"]]}, "$.edges[0].edges[0]: expected the two faces"),
        ({"edges": [["0.+z", "0.top"]]}, "$.edges[0].edges[0]: expected a face like"),
        ({"edges": [["0.+z", "0.wall[0][3]"]]}, "$.edges[0]: extrude 0 has no face wall[0][3]"),
        ({"edges": [["0.+z", "7.side"]]}, "$.edges[0]: 7.side is a face of primitive 7, but there are 2"),
    ],
)
def test_what_is_wrong_is_one_line(changed: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError) as error:  # noqa: PT011
        edges_of(document(**changed))
    assert said in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_older_versions_have_none() -> None:
    with pytest.raises(ValueError, match=r"\$\.edges: version 4 has none"):
        edges_of({**document(), "version": 4})


def test_every_face_has_a_name_that_is_read() -> None:
    kinds = [
        Primitive("box", (1.0, 2.0, 3.0)),
        Primitive("cone", (1.0, 2.0, 3.0)),
        Primitive("torus", (3.0, 1.0)),
        PLATE,
        Primitive("revolve", (360.0,), outline=Outline((((1.0, 0.0, 0.0), (9.0, 0.0, 0.0), (1.0, 6.0, 0.0)),))),
    ]
    for leaf, part in enumerate(kinds):
        for name in faces_of(part):
            assert read_face(f"{leaf}.{name}") == Face(leaf, name)
            check_edges([EdgeFeature("fillet", (1.0,), ((Face(leaf, name), Face(0, "+x")),))], kinds)


def test_sizes_scale() -> None:
    assert scale_edges((MOUTH,), 2.0) == (EdgeFeature("chamfer", (1.0, 0.5), MOUTH.edges),)


def test_names_are_by_kind_and_not_taken() -> None:
    assert [f.name for f in name_edges((RIM, RIM), ["lip_radius"])] == ["lip2", "lip3"]
    named = name_edges((replace(RIM, name=""), MOUTH, MOUTH), ["fillet_radius"])
    assert [f.size_names for f in named] == [
        ("fillet2_radius",),
        ("chamfer_distance", "chamfer_second"),
        ("chamfer2_distance", "chamfer2_second"),
    ]
    assert with_sizes(named, {"chamfer_second": 0.75, "other": 9.0})[1].sizes == (0.5, 0.75)
    assert describe_edges(RIM) == "fillet 1 of 2 edges"
    assert describe_edges(MOUTH) == "chamfer 0.5 x 0.25 of 1 edge"
