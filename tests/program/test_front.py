"""front.json: what is written comes back, and what is wrong with it is said in one line."""

import json

import numpy as np
import pytest
from program_samples import random_program

from imdim.program.codec import Meta
from imdim.program.codec import from_json as program_from
from imdim.program.front import Choice, dumps, loads
from imdim.program.outline import Outline, circle
from imdim.program.tree import KINDS, Combine, Primitive, leaves

META = Meta(center=(1.0, 2.0, 3.0), scale=0.5)


def choices() -> list[Choice]:
    rng = np.random.default_rng(0)
    return [Choice(program_from_text(random_program(rng, k, kinds=KINDS)), 0.5**k) for k in (1, 3, 6)] + [Choice(random_program(rng, 1))]


def program_from_text(program):
    """As it is read back: unions and the like regrouped."""
    return loads(dumps([Choice(program)]))[0][0].program


def test_what_is_written_comes_back():
    read, meta = loads(dumps(choices(), META, picked=2))
    assert read == choices()
    assert meta == META


def test_each_entry_is_a_document_with_its_counts():
    document = json.loads(dumps(choices(), META, picked=2))
    assert document["picked"] == 2
    for number, (entry, choice) in enumerate(zip(document["choices"], choices(), strict=True), 1):
        assert program_from(entry["document"]) == choice.program
        size = len(list(leaves(choice.program)))
        assert (entry["pick"], entry["primitives"], entry["operations"]) == (number, size, size - 1)


def broken(change) -> str:
    document = json.loads(dumps(choices()))
    change(document)
    return json.dumps(document)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", r"\$.format"),
        ("{", r"\$: not JSON"),
        (broken(lambda d: d.update(version=9)), r"\$.version: expected 1, got 9"),
        (broken(lambda d: d.update(choices=[])), r"\$.choices: expected a list"),
        (broken(lambda d: d["choices"].__setitem__(1, 3)), r"\$.choices\[1\]: expected an error and a document"),
        (broken(lambda d: d["choices"][2]["document"]["program"].update(op="glue")), r"\$.choices\[2\].document.*glue"),
    ],
)
def test_bad_input_is_one_line_with_its_place(text, message):
    with pytest.raises(ValueError, match=message) as caught:
        loads(text)
    assert "\n" not in str(caught.value)


def test_features_and_curves_stand_beside_the_primitives_where_there_are_outlines():
    holed = Outline((((0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (0.0, 5.0, 0.0)), circle(0.5, 1.0, 1.0)))
    drawn = Combine("union", Primitive("extrude", (1.0,), outline=holed), Primitive("box", (1.0, 1.0, 1.0)))
    plain, outlined = json.loads(dumps([Choice(drawn.right), Choice(drawn)]))["choices"]
    assert [*plain] == ["pick", "primitives", "operations", "error", "document"]
    assert (outlined["primitives"], outlined["features"], outlined["curves"]) == (2, 2, 4)
