"""What a proof says beside the features that repeat."""

from types import SimpleNamespace

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, mesh_of, union

from imdim.program.cost import CURVE, count
from imdim.program.outline import Outline
from imdim.program.tree import Primitive, Program
from imdim.reconstruction import methods
from imdim.reconstruction import proof as module
from imdim.reconstruction.budget import Budget
from imdim.reconstruction.config import Settings
from imdim.reconstruction.methods import MethodStep, Run
from imdim.reconstruction.observation import UnitBody, observe
from imdim.reconstruction.proof import BESIDE, DEARER, Proofs
from imdim.search.exact.prove import TOO_HARD, Proof
from imdim.target.target import target_from

PLATE = box(0.8, 0.6, 0.1)
PINS = [cylinder(0.03, 0.2, (0.2 * i - 0.3, 0.0, 0.1)) for i in range(4)]


def proofs_at(curve: float) -> Proofs:
    body = UnitBody.of(target_from(mesh_of(union(PLATE, *PINS))), np.random.default_rng(0))
    return Proofs(observe(body, 2.5e-4, np.random.default_rng(0), curve=curve), Budget(60.0))


@pytest.fixture(scope="module")
def proofs() -> Proofs:
    return proofs_at(CURVE)


def test_beside_a_row_one_plate_is_the_fewest(proofs):
    assert proofs.beside_repeats(union(PLATE, *PINS)) == BESIDE


def test_what_is_too_long_beside_it_is_not_proved(proofs):
    halves = box(0.4, 0.6, 0.1, (-0.2, 0.0, 0.0)), box(0.4, 0.5, 0.1, (0.2, 0.05, 0.0)), box(0.4, 0.1, 0.1, (0.2, -0.25, 0.0))
    assert proofs.beside_repeats(union(*halves, *PINS)) == "not proved: fewer primitives do beside what repeats"


def test_without_repeats_there_is_nothing_to_say(proofs):
    assert proofs.beside_repeats(cut(PLATE, cylinder(0.03, 0.2))) is None


def test_where_the_copies_hold_the_whole_body_there_is_nothing_to_say(proofs):
    slabs = [box(0.3, 3.0, 3.0, (0.3 * i - 0.6, 0.0, 0.0)) for i in range(5)]
    assert proofs.beside_repeats(union(*slabs)) is None


def test_where_each_copy_counts_nothing_is_said_beside_them():
    assert proofs_at(0.0).beside_repeats(union(PLATE, *PINS)) is None


@pytest.mark.parametrize(("pins", "said"), [(4, BESIDE), (1, DEARER)])
def test_what_is_shorter_and_dearer_is_not_taken_and_its_proof_is_not_ours(proofs, monkeypatch, pins, said):
    """The proof of the plate alone says nothing of the plate with its pins."""
    monkeypatch.setattr(proofs, "of", lambda program: (PLATE, Proof(True, 1, 9, program=PLATE)))
    best = union(PLATE, *PINS[:pins])
    step = methods._prove(MethodStep("search", best), proofs)
    assert (step.program, step.proof) == (best, said)


def test_what_is_shorter_and_cheaper_is_taken_with_its_proof(proofs, monkeypatch):
    shorter = union(PLATE, *PINS)
    monkeypatch.setattr(proofs, "of", lambda program: (shorter, Proof(True, 5, 9, program=shorter)))
    step = methods._prove(MethodStep("search", union(shorter, box(0.01, 0.01, 0.05, (0.0, 0.2, 0.0)))), proofs)
    assert (step.program, step.proof) == (shorter, "proved minimal over these candidates")


@pytest.mark.parametrize(("why", "asked"), [(TOO_HARD, [5]), ("time ran out", [5, 4])])
def test_what_was_too_hard_for_the_solver_is_asked_again_at_the_end_alone(proofs, monkeypatch, why, asked):
    early, programs = Proofs(proofs.seen, proofs.budget), []
    monkeypatch.setattr(early, "of", lambda program, share: programs.append(program) or (program, Proof(False, 5, 9, why)))
    for pins in (PINS, PINS[:3]):
        early.early(union(PLATE, *pins))
    assert [count(program).primitives for program in programs] == asked


@pytest.mark.parametrize(("blocks", "is_taken"), [(2, True), (16, False)])
def test_nothing_is_proved_of_primitives_that_are_too_many_to_be_taken(monkeypatch, blocks, is_taken):
    """A proof may take ten seconds, of a program that is then left for a drawing."""
    corners = ((-5.0, -5.0), (5.0, -5.0), (5.0, 0.0), (0.0, 0.0), (0.0, 5.0), (-5.0, 5.0))
    drawn = Primitive("extrude", (4.0,), outline=Outline((tuple((x, y, 0.0) for x, y in corners),)))
    found = union(*(box(1.0, 2.0 + 0.1 * i, 4.0, (0.3 * i * i, 0.0, 0.0)) for i in range(blocks)))
    bounds = np.array([-6.0, -6.0, -3.0]), np.array([6.0, 6.0, 3.0])
    families = SimpleNamespace(arrangement=SimpleNamespace(bounds=bounds))
    seen = SimpleNamespace(noisy=False, faceting=0.0, error=lambda _: 0.0, target=SimpleNamespace(mesh=1), families=families)
    seen.without_outlines = seen
    asked: list[Program] = []

    def prove(best: MethodStep, _: Proofs) -> MethodStep:
        asked.append(best.program)
        return best

    monkeypatch.setattr(methods, "_search_and_touch_up", lambda run, proofs, is_promising: iter([MethodStep("search", found)]))
    monkeypatch.setattr(methods, "_prove", prove)
    run = Run(seen, Settings(), lambda: None, Budget(60.0), np.random.default_rng(0))  # type: ignore[arg-type]
    step = methods._search_primitives(run, MethodStep("search", drawn), MethodStep("search", drawn))
    assert (step is not None, asked) == (is_taken, [found] * is_taken)


def test_the_search_asks_no_proof_of_what_promises_nothing(monkeypatch):
    """Programs that the search for primitives passes through are proved only where they may be taken for what is plain already."""
    asked: list[int] = []
    steps = [SimpleNamespace(sequence=[1], families=None)] * 2
    monkeypatch.setattr(methods, "search_structure", lambda *_: iter(steps))
    monkeypatch.setattr(methods, "to_program", lambda *_: union(PLATE, *PINS))
    monkeypatch.setattr(methods, "tidy", lambda found, _: found)
    monkeypatch.setattr(methods, "transfer", lambda found, _: found)
    families, cells = SimpleNamespace(), SimpleNamespace(volume=1.0)
    evidence = SimpleNamespace(exact=False)
    seen = SimpleNamespace(noisy=False, size_weight=1e-3, cells=cells, families=families, evidence=evidence, copies_once=True)
    run = Run(seen, Settings(), lambda: None, Budget(60.0), np.random.default_rng(0))  # type: ignore[arg-type]
    proofs = SimpleNamespace(early=lambda program: asked.append(count(program).primitives))
    for is_promising, times in ((False, 0), (True, 2)):
        list(methods._search_structure(run, proofs, lambda _, promising=is_promising: promising))  # type: ignore[arg-type]
        assert len(asked) == times


def test_where_time_is_out_no_candidates_are_listed(proofs, monkeypatch):
    monkeypatch.setattr(module, "Prover", None)
    late = Proofs(proofs.seen, Budget(0.0))
    assert str(late.of(PLATE)[1]) == "not proved: time ran out"
    assert late.beside_repeats(union(PLATE, *PINS)) is None
