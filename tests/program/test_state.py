import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from program_samples import SIGNED, cloud, inside, inside_primitive, left_fold, random_primitive, random_program

from imdim.program.state import (
    ADD_BOX,
    ADD_CONE,
    ADD_CYLINDER,
    ADD_SPHERE,
    ADD_TORUS,
    END,
    KIND_OF,
    TOKEN_OF,
    UNDO_LAST,
    ShapeState,
    Token,
)
from imdim.program.tree import SIMPLE, Combine, Primitive, combine_all, leaves

BOX_AT = (1.0, 2.0, 3.0, 0.5, 0.6, 0.7, 10.0, 20.0, 30.0)
CUBE, BALL, ROD = Primitive("box", (1.0, 1.0, 1.0)), Primitive("sphere", (0.6,)), Primitive("cylinder", (0.2, 3.0))


def test_the_ids_of_the_tokens_never_change():
    assert [(t.name, int(t)) for t in Token] == [
        ("ADD_BOX", 0),
        ("ADD_SPHERE", 1),
        ("ADD_CYLINDER", 2),
        ("UNDO_LAST", 3),
        ("END", 4),
        ("ADD_CONE", 5),
        ("ADD_TORUS", 6),
    ]
    # the ellipsoid is the optional reading of a sphere's p1, p2
    assert set(KIND_OF.values()) == set(SIMPLE) - {"ellipsoid"}
    assert all(KIND_OF[TOKEN_OF[kind]] == kind for kind in TOKEN_OF)


def test_an_action_decodes_the_vector_and_keeps_it():
    state = ShapeState().apply_action(0, np.array([*BOX_AT, -2.0]))
    (box,) = state.to_primitives()
    assert (box.kind, box.center, box.size, box.rotation, box.sign) == ("box", BOX_AT[:3], BOX_AT[3:6], BOX_AT[6:], -1)
    assert box.raw_params == (*BOX_AT, -2.0)
    assert not state.done


@given(st.floats(-30, 30))
def test_the_sign_is_positive_where_the_sigmoid_reaches_one_half(raw: float):
    probability = 1 / (1 + math.exp(-raw))
    state = ShapeState().apply_action(ADD_BOX, (*BOX_AT, raw))
    if abs(raw) > 1e-12:
        assert state.primitives[0].sign == (1 if probability >= 0.5 else -1)


def test_a_logit_of_zero_is_positive():
    assert ShapeState().apply_action(ADD_BOX, (*BOX_AT, 0.0)).primitives[0].sign == 1


def test_undo_takes_the_last_one_and_changes_nothing_when_empty():
    state = ShapeState().apply_action(ADD_BOX, (*BOX_AT, 1.0)).apply_action(ADD_SPHERE, (*BOX_AT, 1.0))
    assert [p.kind for p in state.apply_action(UNDO_LAST).primitives] == ["box"]
    assert state.apply_action(UNDO_LAST).apply_action(UNDO_LAST).primitives == []


def test_masks():
    state = ShapeState()
    add = {ADD_BOX, ADD_SPHERE, ADD_CYLINDER, ADD_CONE, ADD_TORUS}

    def allowed(**options: bool) -> set[int]:
        return {i for i, ok in enumerate(state.action_mask(**options)) if ok}

    assert allowed() == add
    assert allowed(mask_empty_end=False) == add | {END}
    state.apply_action(ADD_BOX, (*BOX_AT, 1.0))
    assert allowed() == add | {END, UNDO_LAST}
    assert state.action_mask(vocabulary=5) == (True,) * 5
    state.apply_action(UNDO_LAST)
    assert allowed() == add
    assert not any(state.apply_action(END).action_mask())


def test_a_copy_is_a_branch():
    state = ShapeState().apply_action(ADD_BOX, (*BOX_AT, 1.0))
    branch = state.copy().apply_action(ADD_SPHERE, (*BOX_AT, 1.0)).apply_action(END)
    assert (len(state.primitives), state.done) == (1, False)
    assert (len(branch.primitives), branch.done) == (2, True)


@pytest.mark.parametrize(
    ("token", "params", "message"),
    [
        (ADD_BOX, None, "needs 10 parameters, got 0"),
        (ADD_BOX, (1.0,) * 9, "needs 10 parameters, got 9"),
        (ADD_BOX, (*BOX_AT, math.nan), "got nan at index 9"),
        (9, (1.0,) * 10, "unknown token 9"),
    ],
)
def test_a_bad_action_raises(token: int, params: tuple[float, ...] | None, message: str):
    with pytest.raises(ValueError, match=message):
        ShapeState().apply_action(token, params)


def test_nothing_follows_the_end():
    with pytest.raises(ValueError, match="after END"):
        ShapeState().apply_action(END).apply_action(UNDO_LAST)


@given(st.lists(st.floats(-1e6, 1e6), min_size=10, max_size=10), st.sampled_from(sorted(KIND_OF)), st.booleans())
def test_every_finite_vector_reads_as_a_proper_solid(params: list[float], token: int, ellipsoids: bool):
    solid = ShapeState().apply_action(token, params).primitives[0].solid(ellipsoids)
    assert solid.kind == KIND_OF[Token(token)] or (ellipsoids and solid.kind == "ellipsoid")
    assert solid.center == tuple(params[:3])


def test_a_sphere_reads_its_other_sizes_only_on_request():
    vector = (0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0)
    sphere = ShapeState().apply_action(ADD_SPHERE, vector).primitives[0]
    assert sphere.solid() == Primitive("sphere", (1.0,))
    assert sphere.solid(ellipsoids=True) == Primitive("ellipsoid", (1.0, 2.0, 3.0))


def test_the_solid_is_the_sequence_of_unions_and_cuts():
    rng = np.random.default_rng(3)
    state = ShapeState()
    points, expected = cloud(rng), np.zeros(4000, bool)
    for i in range(12):
        p = random_primitive(rng, ["box", "sphere", "cylinder"])
        sign = 1.0 if i == 0 or rng.random() < 0.6 else -1.0
        size = (*p.size, 9.0, 9.0)[:3]
        state.apply_action(TOKEN_OF[p.kind], (*p.center, *size, *p.rotation, sign))
        expected = expected | inside_primitive(p, points) if sign > 0 else expected & ~inside_primitive(p, points)
    program = state.to_program()
    assert program is not None
    assert np.array_equal(inside(program, points), expected)


def test_a_state_without_a_positive_primitive_is_no_program():
    assert ShapeState().to_program() is None
    assert ShapeState().apply_action(ADD_BOX, (*BOX_AT, -1.0)).to_program() is None


@pytest.mark.parametrize("seed", range(20))
def test_a_left_fold_comes_back_as_the_same_tree(seed: int):
    program = left_fold(np.random.default_rng(seed), 1 + seed)
    state = ShapeState.from_program(program)
    assert state.done
    assert state.to_program() == program


def test_replaying_the_actions_gives_the_state():
    state = ShapeState.from_program(left_fold(np.random.default_rng(1), 9))
    replayed = ShapeState(ellipsoids=state.ellipsoids)
    for token, params in state.actions():
        replayed.apply_action(token, params)
    assert replayed == state


@pytest.mark.parametrize(
    "program",
    [
        combine_all("union", [CUBE, Combine("union", BALL, ROD)]),
        Combine("difference", CUBE, Combine("union", BALL, ROD)),
        Combine("union", ROD, Combine("difference", CUBE, BALL)),
    ],
)
def test_other_signed_nestings_keep_the_solid(program: Combine):
    points = cloud(np.random.default_rng(0))
    lifted = ShapeState.from_program(program).to_program()
    assert lifted is not None
    assert sorted(p.kind for p in leaves(lifted)) == sorted(p.kind for p in leaves(program))
    assert np.array_equal(inside(lifted, points), inside(program, points))


@pytest.mark.parametrize(
    ("program", "message"),
    [
        (Combine("intersection", CUBE, BALL), "intersection"),
        (Combine("difference", CUBE, Combine("difference", BALL, ROD)), "a cut that has cuts"),
        (Combine("union", Combine("difference", CUBE, ROD), Combine("difference", BALL, ROD)), "two parts with cuts"),
    ],
)
def test_what_is_no_signed_sequence_is_refused(program: Combine, message: str):
    with pytest.raises(ValueError, match=message):
        ShapeState.from_program(program)


def test_lowering_keeps_the_solid_of_every_random_tree_that_it_accepts():
    rng = np.random.default_rng(11)
    points, accepted = cloud(rng, 2000), 0
    for _ in range(60):
        program = random_program(rng, 4, SIGNED)
        try:
            lifted = ShapeState.from_program(program).to_program()
        except ValueError:
            continue
        accepted += 1
        assert lifted is not None
        assert np.array_equal(inside(lifted, points), inside(program, points))
    assert accepted >= 20
