import pickle
from dataclasses import replace

import numpy as np
import pytest

from imdim.app.lab import protocol
from imdim.app.lab.examples import PROGRAMS, example
from imdim.app.lab.protocol import Message
from imdim.program import codec
from imdim.program.constraints import Constraint, Ref
from imdim.program.front import Choice

PROGRAM = PROGRAMS["Bracket"]()


@pytest.mark.parametrize("name", ["Bracket", "Bracket, scanned"])
def test_targets_come_through(name):
    target = example(name)
    back = protocol.target_of(protocol.unpack_message(protocol.pack_message(protocol.target_message(target))))
    assert (back.name, back.is_solid, back.notes) == (target.name, target.is_solid, target.notes)
    assert np.array_equal(back.points, target.points)
    assert (back.normals is None) == (target.normals is None)
    assert (back.mesh is None) == (target.mesh is None)
    if target.mesh is not None:
        assert np.array_equal(back.mesh.faces, target.mesh.faces)
    seen = protocol.target_message(replace(target, scanners=np.eye(3)))
    assert np.array_equal(protocol.target_of(protocol.unpack_message(protocol.pack_message(seen))).scanners, np.eye(3))


def test_programs_and_fronts_come_through():
    constraints = (Constraint("equal", (Ref(2, "r"), Ref(3, "r"))),)
    assert protocol.read_document(codec.to_json(PROGRAM, None, constraints)) == (PROGRAM, constraints)
    front = (Choice(PROGRAM, 0.5), Choice(PROGRAM, None))
    assert protocol.read_front(protocol.front_values(front)) == front


def test_a_message_that_would_run_code_is_refused():
    body = protocol.pack_message(Message("files", {}, {"a": np.array([1.0])}))
    head = body[: 8 + int.from_bytes(body[:8], "little")]
    with pytest.raises(ValueError, match="pickle"):
        protocol.unpack_message(head + pickle.dumps(print))
