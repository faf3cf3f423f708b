import json
import math
from importlib import resources

import jsonschema
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from program_samples import cloud, inside, left_fold, random_program
from scripts.make_schema import schema, schema_text

from imdim.program import codec
from imdim.program.codec import MAX_DEPTH, MAX_PRIMITIVES, Meta, dumps, from_json, loads, meta_of, parse, to_json
from imdim.program.tree import KINDS, Combine, Primitive, Program, combine_all, leaves

CUBE, BALL = Primitive("box", (1.0, 1.0, 1.0)), Primitive("sphere", (0.6,))
VALIDATOR = jsonschema.Draft202012Validator(schema())


@pytest.mark.parametrize("seed", range(25))
def test_reading_gives_the_same_solid_and_the_same_bytes(seed: int):
    rng = np.random.default_rng(seed)
    program = random_program(rng, int(rng.integers(1, 14)), kinds=KINDS)
    text = dumps(program)
    again = loads(text)
    points = cloud(rng)
    assert list(leaves(again)) == list(leaves(program))
    assert np.array_equal(inside(again, points), inside(program, points))
    assert dumps(again) == text
    VALIDATOR.validate(json.loads(text))
    assert json.loads(text) == to_json(program)


@pytest.mark.parametrize("seed", range(10))
def test_a_left_fold_comes_back_as_the_same_tree(seed: int):
    program = left_fold(np.random.default_rng(seed), 8, KINDS)
    assert loads(dumps(program)) == program


@given(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 6), st.floats(min_value=0, exclude_min=True, allow_infinity=False))
def test_every_number_comes_back_exactly(numbers: tuple[float, ...], radius: float):
    program = Primitive("sphere", (radius,), numbers[:3], numbers[3:])  # type: ignore[arg-type]
    again = loads(dumps(program))
    assert isinstance(again, Primitive)
    assert [v.hex() for v in (*again.size, *again.center, *again.rotation)] == [v.hex() for v in (radius, *numbers)]


def test_chains_are_written_flat():
    a, b, c, d = (Primitive("sphere", (r,)) for r in (1.0, 2.0, 3.0, 4.0))
    union = Combine("union", a, Combine("union", Combine("union", b, c), d))
    assert [part["size"]["r"] for part in to_json(union)["program"]["parts"]] == [1.0, 2.0, 3.0, 4.0]
    spine = Combine("difference", Combine("difference", a, b), Combine("difference", c, d))
    assert [part.get("op") for part in to_json(spine)["program"]["parts"]] == [None, None, "difference"]


def test_the_text_is_meant_to_be_read():
    program = Combine("difference", CUBE, Primitive("cylinder", (0.1, 1.2), (0.0, 0.0, 0.05)))
    assert dumps(program, Meta("millimeter", (1.0, 2.0, 3.0), 0.5)) == (
        "{\n"
        '  "format": "imdim-csg",\n'
        '  "version": 1,\n'
        '  "units": "millimeter",\n'
        '  "frame": {"axes": "right-handed", "rotation": "Rz @ Ry @ Rx, degrees", "center": [1.0, 2.0, 3.0], "scale": 0.5},\n'
        '  "program": {"op": "difference", "parts": [\n'
        '    {"kind": "box", "size": {"sx": 1.0, "sy": 1.0, "sz": 1.0}, "center": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]},\n'
        '    {"kind": "cylinder", "size": {"r": 0.1, "h": 1.2}, "center": [0.0, 0.0, 0.05], "rotation": [0.0, 0.0, 0.0]}\n'
        "  ]}\n"
        "}\n"
    )


def test_meta_comes_back():
    meta = Meta("inch", (1.0, -2.0, 0.1), 0.25)
    assert meta_of(parse(dumps(CUBE, meta))) == meta
    assert meta_of({"format": "imdim-csg", "version": 1, "program": to_json(CUBE)["program"]}) == Meta()
    with pytest.raises(ValueError, match="unknown units 'mm'"):
        Meta("mm")


def test_the_published_schema_is_the_generated_one():
    published = resources.files("imdim.program").joinpath("program.schema.json").read_text(encoding="utf-8")
    assert published == schema_text()
    jsonschema.Draft202012Validator.check_schema(json.loads(published))


def edited(path: str, value: object) -> dict:
    """A good document with the entry at `path` (dots and indices) replaced; a value of ... removes it."""
    document = to_json(Combine("difference", CUBE, Primitive("torus", (0.5, 0.1))))
    *way, last = (int(step) if step.isdigit() else step for step in path.split("."))
    node = document
    for step in way:
        node = node[step]
    if value is ...:
        del node[last]
    else:
        node[last] = value
    return document


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("format", "stl", "$.format: expected 'imdim-csg', got 'stl'"),
        ("version", 7, "$.version: this reader knows versions 1, 2, 3, 4, 5, 6, got 7"),
        ("version", True, "$.version: this reader knows versions 1, 2, 3, 4, 5, 6, got True"),
        ("units", "mile", "$.units: expected unspecified or micron or millimeter or centimeter or meter or inch or foot, got 'mile'"),
        ("frame.scale", -1, "$.frame.scale: needs a positive number, got -1.0"),
        ("frame.axes", "left-handed", "$.frame.axes: expected right-handed, got 'left-handed'"),
        ("program", ..., "$: 'program' is missing"),
        ("program", [], "$.program: expected an object, got a list of 0"),
        ("program.op", "xor", "$.program.op: expected union or intersection or difference, got 'xor'"),
        ("program.parts", [], "$.program.parts: a difference needs a list of 2 or more parts, got 0 of them"),
        (
            "program.parts.1.kind",
            "tours",
            f"$.program.parts[1].kind: expected {' or '.join(KINDS)}, got 'tours'",
        ),
        ("program.parts.0.size.sx", -2, "$.program.parts[0].size: box needs positive sx, got -2.0"),
        ("program.parts.0.size.sx", "2", "$.program.parts[0].size.sx: expected a number, got '2'"),
        ("program.parts.0.size.sx", True, "$.program.parts[0].size.sx: expected a number, got True"),
        ("program.parts.0.size.sx", 10**400, "$.program.parts[0].size.sx: expected a finite number, got an integer of 1329 bits"),
        ("program.parts.0.size.sx", math.inf, "$.program.parts[0].size.sx: expected a finite number, got inf"),
        ("program.parts.1.size.r_minor", 3, "$.program.parts[1].size: torus needs r_minor <= r_major, got (0.5, 3.0)"),
        ("program.parts.0.centre", [0, 0, 0], "$.program.parts[0]: unknown key 'centre'; did you mean 'center'?"),
        ("program.parts.0.center", [0, 0], "$.program.parts[0].center: expected a list of 3 numbers, got 2 entries"),
        ("program.parts.0.rotation", [0, None, 0], "$.program.parts[0].rotation[1]: expected a number, got None"),
        ("program.parts.0.x\n", 1, "$.program.parts[0]: unknown key 'x\\n'"),
    ],
)
def test_what_is_wrong_is_said_in_one_line_with_path_and_number(path: str, value: object, message: str):
    with pytest.raises(ValueError, match="\\$") as caught:
        from_json(edited(path, value))
    assert str(caught.value) == message


@pytest.mark.parametrize("path", ["format", "program", "program.op", "program.parts", "program.parts.0.kind", "program.parts.0.size.sx"])
def test_the_schema_refuses_what_the_codec_refuses(path: str):
    assert not VALIDATOR.is_valid(edited(path, ...))
    assert not VALIDATOR.is_valid(edited(path, -1))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not JSON: Expecting value"),
        ("{'a': 1}", "not JSON"),
        (b"\xff\xfe\xfd", "not JSON"),
        ('{"format": NaN}', "NaN is not a number of JSON"),
        ('{"format": 1, "format": 2}', "the key 'format' occurs twice"),
        ("[" * 100_000, "nested too deep"),
        (" " * (codec.MAX_CHARACTERS + 1), "characters; at most"),
        ('{"format": "imdim-csg", "version": 1, "program": ' + "1" * 5000 + "}", "not JSON"),
    ],
)
def test_hostile_text_gives_one_line(text: str | bytes, message: str):
    with pytest.raises(ValueError, match=message) as caught:
        loads(text)
    assert str(caught.value).startswith("$: ")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.sampled_from(["union", "box", "imdim-csg"]),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(["op", "parts", "kind", "size", "sx", "r", "center"]), inner)
    ),
    max_leaves=12,
)


@given(
    ANYTHING, st.sampled_from(["program", "program.parts", "program.parts.0", "program.parts.0.size", "program.parts.1.center", "frame"])
)
def test_no_json_value_anywhere_raises_anything_but_one_short_line(value: object, path: str):
    message = "$"
    try:
        from_json(edited(path, value))
    except ValueError as error:
        message = str(error)
    assert message.startswith("$")
    assert "\n" not in message
    assert len(message) < 500


def nested(depth: int) -> Program:
    program: Program = CUBE
    for i in range(depth):
        program = Combine("union" if i % 2 else "difference", program, BALL)
    return program


def test_depth_is_capped_on_both_ways():
    assert loads(dumps(nested(MAX_DEPTH))) is not None
    with pytest.raises(ValueError, match=f"got 202 and {MAX_DEPTH + 1}"):
        dumps(nested(MAX_DEPTH + 1))
    node = to_json(CUBE)["program"]
    for _ in range(MAX_DEPTH + 1):
        node = {"op": "difference", "parts": [node, node]}
    with pytest.raises(ValueError, match=f"more than {MAX_DEPTH} operations") as caught:
        from_json({"format": "imdim-csg", "version": 1, "program": node})
    assert len(str(caught.value)) < 300


def test_the_number_of_primitives_is_capped_on_both_ways():
    with pytest.raises(ValueError, match="got 10001"):
        to_json(combine_all("union", [BALL] * (MAX_PRIMITIVES + 1)))
    node = to_json(CUBE)["program"]
    for _ in range(20):
        # a million primitives by shared nodes
        node = {"op": "union", "parts": [node, node]}
    with pytest.raises(ValueError, match=f"more than {MAX_PRIMITIVES} primitives"):
        from_json({"format": "imdim-csg", "version": 1, "program": node})


def test_a_long_union_is_shallow():
    program = combine_all("union", [BALL] * 2000)
    assert sum(1 for _ in leaves(loads(dumps(program)))) == 2000
