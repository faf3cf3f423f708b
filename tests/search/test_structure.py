"""Planted parts must be found again, from exact surfaces, with no more primitives than they were drawn with."""

import os
import sys
from dataclasses import replace

import numpy as np
import pytest
from tests.deadlines import PASSED
from tests.planted import PARTS, box, common, cut, cylinder, union
from tests.search.planted_families import families_of, planted

from imdim import side_process
from imdim.deadline import NEVER, Deadline
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.cost import count
from imdim.program.sequence import Step
from imdim.program.tree import leaves
from imdim.search import lns, structure
from imdim.search.candidate_families import Candidate, Families
from imdim.search.lazy_bounds import GainBounds
from imdim.search.lns import LocalConfig, complete, improve, rate_sequence
from imdim.search.minimal_ranges import tidy
from imdim.search.sequence import Covered, Price, cost, run, shapes_of, spell_out, to_program
from imdim.search.structure import StructureConfig, search


def searched(name: str, seed: int = 0):
    return list(search(planted(name), StructureConfig(), np.random.default_rng(seed), NEVER))


@pytest.mark.parametrize("name", PARTS)
def test_a_planted_part_is_found_again(name):
    families, found = planted(name), searched(name)
    assert [f.objective for f in found] == sorted((f.objective for f in found), reverse=True)
    program = to_program(tidy(found[-1].sequence, families), families)
    assert count(program).primitives <= count(PARTS[name]).primitives
    assert volume_iou(to_manifold(program), to_manifold(PARTS[name])) >= 0.995


@pytest.mark.parametrize("name", PARTS)
def test_tidy_keeps_the_cells(name):
    families, sequence = planted(name), searched(name)[-1].sequence
    shorter = tidy(sequence, families)
    m = len(families.cells.points)
    assert np.array_equal(run(shorter, m), run(sequence, m))
    assert cost(shorter) == cost(spell_out(sequence, families))
    low, high = families.arrangement.bounds
    # nothing that ends in a plane reaches beyond the near sentinels
    for leaf in leaves(to_program(shorter, families)):
        if leaf.kind == "cylinder":
            assert leaf.size[1] <= np.linalg.norm(high - low) * 1.01


def test_tidy_shortens_what_something_else_cuts_off():
    families = families_of(common(cylinder(5, 30), box(20, 20, 8)))
    (axis,) = families.arrangement.axis_of
    last = len(families.arrangement.directions[axis].offsets) - 1
    long = Candidate(("curved", 0), ((0, last),))
    frame = families.arrangement.frames[0]
    offsets = [families.arrangement.directions[i].offsets for i in frame]
    ends = [4.0 if i == axis else 10.0 for i in frame]
    slab = Candidate(("box", 0), tuple(tuple(int(np.argmin(np.abs(o - s))) for s in (-e, e)) for o, e in zip(offsets, ends, strict=True)))  # type: ignore[arg-type]
    sequence = tuple(Step(op, Covered.of(c, families)) for op, c in (("union", long), ("intersection", slab)))  # type: ignore[arg-type]
    rod, _ = leaves(to_program(tidy(sequence, families), families))
    assert families.primitive(long).size[1] > 8.5
    assert rod.size == pytest.approx((5, 8))


def test_tidy_takes_back_what_only_later_cells_show_to_be_wrong():
    families = families_of(common(cylinder(5, 8), box(20, 20, 20)))
    (axis,) = families.arrangement.axis_of
    offsets = families.arrangement.directions[axis].offsets
    first, last = (int(np.argmin(np.abs(offsets - s))) for s in (-4.0, 4.0))
    bulging = Candidate(("curved", 0), ((first, last + 1),))
    rod = to_program(tidy((Step("union", Covered.of(bulging, families)),), families), families)
    assert families.primitive(bulging).size[1] > 8.2
    assert next(leaves(rod)).size == pytest.approx((5, 8))


def test_the_same_seed_finds_the_same():
    a, b = searched("bored ball", 3)[-1], searched("bored ball", 3)[-1]
    assert [(s.op, s.term) for s in a.sequence] == [(s.op, s.term) for s in b.sequence]
    assert a.objective == b.objective


@pytest.mark.skipif(sys.platform != "linux", reason="copies of a process are for Linux")
@pytest.mark.parametrize("name", list(PARTS)[:3])
def test_two_cores_find_the_same(name, monkeypatch):
    monkeypatch.setattr(side_process, "can_fork", lambda: False)
    alone = [(f.sequence, f.objective) for f in searched(name)]
    forks = []
    fork = os.fork
    monkeypatch.setattr(side_process, "can_fork", lambda: True)
    monkeypatch.setattr(os, "fork", lambda: forks.append(fork()) or forks[-1])
    assert [(f.sequence, f.objective) for f in searched(name)] == alone
    assert forks


def test_a_deadline_cuts_the_search_short():
    families = planted("plate with four holes")
    calls = iter(range(10**9))
    hurried = list(search(families, StructureConfig(), np.random.default_rng(0), Deadline(6, calls.__next__)))
    assert next(calls) < 60
    assert hurried
    assert hurried[-1].sequence


def test_what_is_slow_to_fit_is_bettered_no_longer(monkeypatch):
    """The starts are completed in their time; local search ends by what the best of these says."""
    asked, deadlines = [], []
    plain = structure.improve
    monkeypatch.setattr(structure, "improve", lambda *given: deadlines.append(given[4]) or plain(*given))
    families = planted("plate with four holes")
    *_, last = search(families, StructureConfig(), np.random.default_rng(0), NEVER, better_by=lambda best: asked.append(best) or PASSED)
    assert set(deadlines) == {PASSED}
    assert [last] == asked


def test_of_a_target_without_volume_there_is_nothing():
    known = planted(next(iter(PARTS)))
    nothing = Families(known.arrangement, replace(known.cells, w_in=np.zeros_like(known.cells.w_in)))
    assert {found.sequence for found in search(nothing, StructureConfig(), np.random.default_rng(0), NEVER)} <= {()}


def test_even_without_time_there_is_a_sequence():
    assert list(search(planted("L bracket"), StructureConfig(), np.random.default_rng(0), PASSED))


def test_no_move_is_made_twice(monkeypatch):
    """The same steps taken out of the same sequence, refilled under the same weights, end as they did: in a worse one, or in one as good,
    from which other moves lead back."""
    refill, moves = lns._refill, []

    def watched(found, removed, weights, *rest):
        moves.append((shapes_of(found.sequence), removed, weights))
        return refill(found, removed, weights, *rest)

    families, config = planted("countersink"), LocalConfig()
    price = Price(2.5e-4 * families.cells.volume)
    start = complete(rate_sequence((), families, price), config, price, NEVER)
    monkeypatch.setattr(lns, "_refill", watched)
    assert all(found.objective < start.objective for found in improve(start, config, price, np.random.default_rng(0), NEVER, GainBounds()))
    assert len(moves) == len(set(moves)) > 3


@pytest.mark.parametrize("across", [[(5, -28), (7, -3), (4, 25)], [(4, -31), (6, -8), (7, 29)]])
def test_windows_are_a_cavity_with_bars(across):
    """Twelve windows between bars, each (width, place): a plate, a cavity and the bars in it are fewer primitives."""
    bars = [*(box(w, 62, 4, (x, 0, 0)) for w, x in across), *(box(92, w, 4, (0, y, 0)) for w, y in [(6, -13), (5, 12)])]
    part = union(cut(box(110, 80, 4), box(92, 62, 6)), *bars)
    families = families_of(part)
    config = StructureConfig(patterns=False, local=LocalConfig(kinds=True))
    *_, found = search(families, config, np.random.default_rng(0), NEVER)
    program = to_program(found.sequence, families)
    assert count(program).primitives <= count(part).primitives
    assert volume_iou(to_manifold(program), to_manifold(part)) > 0.999
