"""Constraints as data: what is ill-formed is refused in one line that names it, what is well-formed comes back from JSON."""

import json
from dataclasses import replace

import jsonschema
import pytest
from scripts.make_schema import schema

from imdim.program.codec import constraints_of, dumps, from_json, loads, parse, to_json
from imdim.program.constraints import RULES, Constraint, ConstraintError, Ref, check_all, read_ref
from imdim.program.roles import labels, name_constraints
from imdim.program.tree import Combine, Primitive, combine_all, leaves

PLATE = Primitive("box", (80.0, 50.0, 6.0))
HOLES = [Primitive("cylinder", (3.0, 8.0), (x, y, 0.0)) for x in (-30.0, 30.0) for y in (-15.0, 15.0)]
PROGRAM = Combine("difference", PLATE, combine_all("union", HOLES))
PARTS = list(leaves(PROGRAM))

GOOD = (
    Constraint("parallel", (Ref(-1, "z"), Ref(0, "z"), Ref(1, "z"))),
    Constraint("perpendicular", (Ref(0, "x"), Ref(1, "z"))),
    Constraint("equal", (Ref(1, "r"), Ref(2, "r"), Ref(3, "r"), Ref(4, "r")), name="hole_radius"),
    Constraint("value", (Ref(1, "r"),), value=3.0),
    Constraint("coplanar", (Ref(0, "+z"), Ref(1, "+z")), value=1.0),
    Constraint("aligned", (Ref(1), Ref(2)), Ref(-1, "x")),
    Constraint("coaxial", (Ref(1, "z"), Ref(1 + 1, "z"))),
    Constraint("concentric", (Ref(0), Ref(1))),
    Constraint("tangent", (Ref(1, "r"), Ref(0, "+x"))),
    Constraint("symmetric", (Ref(1), Ref(3), Ref(0)), Ref(0, "x")),
    Constraint("linear", (Ref(1), Ref(0), Ref(4))),
    Constraint("circular", (Ref(1), Ref(4)), Ref(0, "z")),
)


def test_every_kind_is_read_and_written():
    assert {c.kind for c in GOOD} == set(RULES)
    text = dumps(PROGRAM, constraints=GOOD)
    document = json.loads(text)
    assert constraints_of(parse(text)) == GOOD
    assert loads(text) == PROGRAM or list(leaves(loads(text))) == PARTS
    assert document["version"] == 2
    assert dumps(loads(text), constraints=constraints_of(document)) == text
    jsonschema.Draft202012Validator(schema()).validate(document)


def test_a_program_without_constraints_keeps_its_version():
    assert to_json(PROGRAM)["version"] == 1
    assert constraints_of(to_json(PROGRAM)) == ()
    with pytest.raises(ValueError, match=r"\$\.constraints: version 1 has none"):
        from_json({**to_json(PROGRAM), "constraints": []})


@pytest.mark.parametrize(
    ("constraint", "message"),
    [
        (Constraint("equal", (Ref(1, "r"), Ref(9, "r"))), r"constraints\[0\].*9\.r is out of range, the program has 5 primitives"),
        (Constraint("equal", (Ref(1, "r"), Ref(0, "r"))), r"0\.r is no size of a box"),
        (Constraint("equal", (Ref(1, "r"),), name="radius"), r"constraints\[0\] 'radius' .*needs 2 or more features, got 1"),
        (Constraint("equal", (Ref(1, "r"), Ref(1, "r"))), "one feature twice, a reference of no length"),
        (Constraint("value", (Ref(1, "r"),), value=0.0), "a reference of no length"),
        (Constraint("tangent", (Ref(0, "+x"), Ref(1, "r"))), r"0\.\+x is no radius, which the first of the two has to be"),
        (Constraint("tangent", (Ref(1, "r"), Ref(0, "sx"))), r"0\.sx is no wall of a box"),
        (Constraint("value", (Ref(1, "r"),), value=float("nan")), "its value is not finite"),
        (Constraint("parallel", (Ref(0, "z"), Ref(1, "x"))), r"1\.x is no axis of a cylinder"),
        (Constraint("coplanar", (Ref(0, "+z"), Ref(-1, "z"))), r"world\.z is no face"),
        (Constraint("aligned", (Ref(0), Ref(1))), "lacks about"),
        (Constraint("parallel", (Ref(0, "z"), Ref(1, "z")), Ref(0, "z")), "takes no about"),
        (Constraint("parallel", (Ref(0, "z"), Ref(1, "z")), value=1.0), "takes no value"),
        (Constraint("circular", (Ref(1), Ref(2)), Ref(1, "z")), "two members alone say nothing"),
        (Constraint("smooth", (Ref(1), Ref(2))), "unknown kind 'smooth'; known are"),
    ],
)
def test_what_is_ill_formed_is_named(constraint, message):
    with pytest.raises(ConstraintError, match=message) as caught:
        check_all([constraint], PARTS)
    assert "\n" not in str(caught.value)


def test_steps_and_circles_of_no_length_are_refused():
    same = [PLATE, *(replace(HOLES[0], size=(r, 8.0)) for r in (1.0, 2.0, 3.0))]
    with pytest.raises(ConstraintError, match="a reference of no length, 1 and 2 coincide"):
        check_all([Constraint("linear", (Ref(1), Ref(2), Ref(3)))], same)
    with pytest.raises(ConstraintError, match=r"a reference of no length, 0\.r_top is 0"):
        check_all([Constraint("equal", (Ref(0, "r_top"), Ref(0, "r_bottom")))], [Primitive("cone", (1.0, 0.0, 2.0))])


def test_two_values_for_one_length_contradict_each_other():
    chain = [Constraint("equal", (Ref(1, "r"), Ref(2, "r"))), Constraint("equal", (Ref(2, "r"), Ref(3, "r")))]
    values = [Constraint("value", (Ref(1, "r"),), value=3.0), Constraint("value", (Ref(3, "r"),), value=4.0, name="bore")]
    with pytest.raises(ConstraintError, match=r"constraints\[3\] 'bore' \(value of 3\.r value 4\): contradicts constraints\[2\]"):
        check_all([*chain, *values], PARTS)
    check_all([*chain, values[0], replace(values[1], value=3.0)], PARTS)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"kind": "equal", "of": ["1.r", "7.r"]}, r"\$\.constraints\[0\] \(equal of 1\.r, 7\.r\): 7\.r is out of range"),
        ({"kind": "equal", "of": ["1.r", "two"]}, r"\$\.constraints\[0\]\.of\[1\]: expected a feature like .*, got 'two'"),
        ({"kind": "equal", "of": 3}, r"\$\.constraints\[0\]\.of: expected a list"),
        ({"kind": "value", "of": ["1.r"], "value": "3"}, r"\$\.constraints\[0\]\.value: expected a number"),
        ({"kind": "value", "of": ["1.r"], "value": float("inf")}, r"\$\.constraints\[0\]\.value: expected a finite number"),
        ({"kind": "equal", "of": ["1.r", "2.r"], "name": "a b"}, r"\$\.constraints\[0\]\.name: expected a name"),
        ({"kind": "equals", "of": ["1.r", "2.r"]}, r"\$\.constraints\[0\]\.kind: expected equal or"),
        ({"of": ["1.r", "2.r"]}, r"\$\.constraints\[0\]: 'kind' is missing"),
    ],
)
def test_bad_json_gives_one_line(entry, message):
    document = {**to_json(PROGRAM), "version": 2, "constraints": [entry]}
    with pytest.raises(ValueError, match=message) as caught:
        constraints_of(document)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "1.", ".r", "-1.r", "1.R", "world.", "1.r ", None, 3, "9" * 20])
def test_a_feature_is_one_of_ours(text):
    with pytest.raises(ValueError, match="expected a feature"):
        read_ref(text)


def test_names_say_what_parts_are_for():
    assert labels(PROGRAM, GOOD) == ["plate", "hole", "hole", "hole", "hole"]
    found = name_constraints([replace(c, name="") for c in GOOD], PROGRAM)
    assert found[2].name == "hole_radius"
    assert len({c.name for c in found}) == len(found)
    turned = Combine("union", Primitive("cylinder", (2.0, 9.0)), Primitive("cylinder", (4.0, 1.0)))
    assert labels(turned) == ["shaft", "boss"]
    assert labels(Combine("difference", Primitive("cylinder", (9.0, 2.0)), Primitive("cone", (1.0, 2.0, 1.0)))) == ["disc", "countersink"]
