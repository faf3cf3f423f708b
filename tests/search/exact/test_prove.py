"""Proofs against all programs over all candidates of small arrangements, and what happens where none can be had."""

from itertools import combinations

import numpy as np
import pytest
from tests.deadlines import PASSED
from tests.planted import PARTS, box, common, cut, cylinder, sphere, union
from tests.search.planted_families import cells_of, families_of, planted

from imdim.geometry import kernels
from imdim.program.cost import count
from imdim.program.tree import Program
from imdim.search.bits import pack_words, unpack_words
from imdim.search.candidate_families import Candidate, Families
from imdim.search.cells import Cells
from imdim.search.exact.columns import maximal_columns
from imdim.search.exact.prove import ProveConfig, Prover

SIZE_WEIGHT = 2.5e-4
NESTED = cut(box(60, 40, 20), cut(box(30, 20, 30, (10.0, 5.0, 0.0)), cylinder(6, 40, (10.0, 5.0, 0.0))))


def every_mask(families: Families) -> np.ndarray:
    """The distinct cell sets of all candidates, listed by plain loops."""
    arrangement, out = families.arrangement, set()
    ranges = [list(combinations(range(len(d.offsets)), 2)) for d in arrangement.directions]
    for f, (a, b, c) in enumerate(arrangement.frames):
        out |= {families.mask(Candidate(("box", f), (i, j, k))).tobytes() for i in ranges[a] for j in ranges[b] for k in ranges[c]}
    for i, axis in enumerate(arrangement.axis_of):
        out |= {families.mask(Candidate(("curved", i), (r,))).tobytes() for r in (ranges[axis] if axis >= 0 else [(0, 1)])}
    return np.array([np.frombuffer(o, bool) for o in sorted(out)])


def least_price(families: Families, size: int) -> float:
    """The least price of all programs of one or two primitives (every such tree is a pair and an operation)."""
    cells, masks = families.cells, every_mask(families)
    gain = cells.gain / (SIZE_WEIGHT * cells.volume)
    filled = masks.astype(float) @ gain
    best = float(filled.max())
    if size == 2:
        both = (masks * gain) @ masks.T.astype(float)
        best = max(best, *(float(v.max()) for v in (both, filled[:, None] + filled - both, filled[:, None] - both)))
    return size + float(np.maximum(gain, 0).sum()) - best


def small(program: Program) -> Families:
    return families_of(program, 6_000)


@pytest.mark.parametrize(
    "program", [box(10, 8, 6), union(box(10, 8, 6), box(4, 8, 12, (3.0, 0.0, 3.0))), cut(box(20, 20, 6), cylinder(4, 9))]
)
def test_what_is_proved_is_the_optimum_of_all_programs(program: Program):
    families = small(program)
    n = count(program).primitives
    mixed = float(np.minimum(families.cells.w_in, families.cells.w_out).sum())
    for asked in (n, n + 1, n + 3):
        proof = Prover(families, SIZE_WEIGHT).prove(asked, mixed)
        assert (proof.minimal, proof.primitives) == (True, n)
        assert (proof.program is None) == (asked == n)
    if n == 2:
        assert least_price(families, 1) > 2.0
    assert least_price(families, n) == pytest.approx(n, abs=0.01)


@pytest.mark.parametrize("seed", [1, 3, 4, 5])
def test_contradictory_labels_are_bounded_as_brute_force_bounds_them(seed: int):
    """No program is right; what is said about programs of one primitive still is so."""
    clean = small(box(20, 20, 6))
    rng = np.random.default_rng(seed)
    cells = clean.cells
    volume = cells.w_in + cells.w_out
    inside = rng.random(len(volume))
    families = Families(clean.arrangement, Cells(cells.points, cells.slabs, cells.inside, volume * inside, volume * (1 - inside)))
    error = least_price(families, 1) - 1  # of the best primitive, in units of the price of one
    unit = SIZE_WEIGHT * families.cells.volume
    mixed = float(np.minimum(families.cells.w_in, families.cells.w_out).sum())
    for given, better in ((error - 1.2, False), (error - 0.8, True)):
        proof = Prover(families, SIZE_WEIGHT, ProveConfig(most_barred=2)).prove(2, given * unit + mixed)
        if proof.minimal:
            assert proof.primitives == (1 if better else 2)
        else:  # the complement of a candidate tells as much apart as the candidate, and is no solid
            assert "no tree" in proof.why


@pytest.mark.parametrize("name", PARTS)
def test_planted_parts_are_minimal_or_can_be_shorter(name: str):
    families, n = planted(name), count(PARTS[name]).primitives
    mixed = float(np.minimum(families.cells.w_in, families.cells.w_out).sum())
    proof = Prover(families, SIZE_WEIGHT).prove(n, mixed)
    assert proof.minimal
    assert proof.primitives <= n


@pytest.mark.parametrize(
    "program", [NESTED, common(sphere(20), box(50, 50, 28)), cut(box(40, 40, 10), common(sphere(12, (0.0, 0.0, 5.0)), box(14, 30, 30)))]
)
def test_a_nested_tree_is_found_below_a_long_program(program: Program):
    families, n = families_of(program), count(program).primitives
    proof = Prover(families, SIZE_WEIGHT).prove(n + 4, 0.5 * families.cells.volume)
    assert (proof.minimal, proof.primitives) == (True, n)
    assert proof.program is not None
    points = families.cells.points
    filled = kernels.inside(proof.program, points)
    assert families.cells.volume * 1e-3 > np.where(filled, families.cells.w_out, families.cells.w_in).sum()
    # again the same, to the last digit
    assert Prover(families, SIZE_WEIGHT).prove(n + 4, 0.5 * families.cells.volume) == proof


def test_half_of_the_surfaces_still_give_an_answer():
    """Carriers of one half of a part: cells of the other are contradictory."""
    whole = union(box(40, 20, 6), box(10, 20, 20, (10.0, 0.0, 10.0)), sphere(7, (-12.0, 0.0, 6.0)))
    arrangement = families_of(box(40, 20, 6)).arrangement
    families = Families(arrangement, cells_of(arrangement, whole, 20_000))
    proof = Prover(families, SIZE_WEIGHT).prove(3, 0.8 * families.cells.volume)
    assert proof.minimal
    assert proof.primitives == 1
    assert proof.program is not None


def test_time_and_size_end_a_proof_with_a_reason():
    families = planted("bored ball")
    late = Prover(families, SIZE_WEIGHT).prove(9, 0.1, PASSED)
    assert (late.minimal, late.program, str(late)) == (False, None, "not proved: time ran out")
    long = Prover(families, SIZE_WEIGHT, ProveConfig(most_primitives=4)).prove(5, 0.0)
    assert str(long) == "not proved: more than 4 primitives"


def test_columns_are_the_maximal_ones():
    families = small(cut(box(20, 20, 6), cylinder(4, 9)))
    rng = np.random.default_rng(0)
    m = len(families.cells.points)
    left, right = rng.integers(0, m, 70), rng.integers(0, m, 70)
    masks = every_mask(families)
    every = {c.tobytes() for c in masks[:, left] ^ masks[:, right] if c.any()}
    rows = np.array([np.frombuffer(c, bool) for c in every])
    outside = rows.astype(np.float32) @ ~rows.T  # how many pairs of one row the other does not hold
    held = (outside == 0).sum(1) > 1
    maximal = {r.tobytes() for r in rows[~held]}
    found = maximal_columns(families, left, right)
    assert {r.tobytes() for r in unpack_words(found.bits, 70)} == maximal
    for bits, candidate in zip(unpack_words(found.bits, 70), found.candidates, strict=True):
        mask = families.mask(candidate)
        assert np.array_equal(bits, mask[left] ^ mask[right])
    assert np.array_equal(unpack_words(pack_words(rows), 70), rows)
