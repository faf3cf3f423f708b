"""CSG-Stump's binary program against all matrices over a few primitives, and on noisy and large ones."""

from itertools import combinations, product

import numpy as np
import pytest
from stump_forms import evaluate
from tests.planted import box, sphere

from imdim.search.exact.stump import EXACT, connections, matrices


def scene(rng: np.random.Generator, k: int, m: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random columns [k, m] with volumes inside and outside; the last cell is outside of everything, as beyond a part."""
    masks = rng.random((k, m)) < 0.5
    masks[:, -1] = False
    w_in, w_out = rng.random(m), rng.random(m)
    w_in[-1], w_out[-1] = 0.0, 5.0
    return masks, w_in, w_out


def least(masks: np.ndarray, w_in: np.ndarray, w_out: np.ndarray, literal: float) -> float:
    """The least price of all matrices, by brute force over sets of intersections."""
    k = len(masks)
    terms = [t for t in product((None, False, True), repeat=k) if False in t]
    covers = [np.logical_and.reduce([masks[i] != flip for i, flip in enumerate(t) if flip is not None]) for t in terms]
    sizes = [sum(flip is not None for flip in t) for t in terms]
    best = np.inf
    for count in range(1, 4):
        for some in combinations(range(len(terms)), count):
            covered = np.logical_or.reduce([covers[i] for i in some])
            price = float(np.where(covered, w_out, w_in).sum()) + literal * sum(sizes[i] for i in some)
            best = min(best, price)
    return best


@pytest.mark.parametrize("seed", range(12))
def test_few_primitives_are_connected_as_cheaply_as_can_be(seed: int):
    rng = np.random.default_rng(seed)
    masks, w_in, w_out = scene(rng, 3, 9)
    literal = float(rng.choice([0.1, 0.2, 0.4]))
    found = connections(masks, w_in, w_out, literal)
    assert found.optimal
    # three intersections are as many as three primitives can use at these prices
    assert found.price == pytest.approx(least(masks, w_in, w_out, literal), abs=1e-6)


@pytest.mark.parametrize("k", [2, 5, 12])
def test_matrices_mean_what_was_chosen(k: int):
    rng = np.random.default_rng(k)
    masks, w_in, w_out = scene(rng, k, 300)
    found = connections(masks, w_in, w_out, 0.5)
    stump = matrices(found.terms, [sphere(1.0 + i) for i in range(k)])
    index = [round(p.size[0]) - 1 for p in stump.primitives]
    covered = evaluate(stump, [masks[i] for i in index])
    assert float(np.where(covered, w_out, w_in).sum()) == pytest.approx(found.error)
    assert found.price == pytest.approx(found.error + 0.5 * sum(map(len, found.terms)))


def test_many_primitives_with_wrong_labels():
    """A planted union of differences among decoys, three in a hundred labels wrong."""
    rng = np.random.default_rng(3)
    masks = rng.random((14, 4000)) < 0.4
    truth = (masks[0] & ~masks[1]) | (masks[2] & masks[3])
    inside = truth ^ (rng.random(4000) < 0.03)
    found = connections(masks, inside.astype(float), (~inside).astype(float), 20.0)
    assert len(masks) > EXACT
    assert not found.optimal
    covered = evaluate(
        matrices(found.terms, [box(1 + i, 1, 1) for i in range(14)]),
        [masks[k] for k, _ in sorted({t for term in found.terms for t in term})],
    )
    assert (covered != truth).mean() < 0.01
    assert sum(map(len, found.terms)) == 4


def test_there_is_always_an_intersection():
    """Nothing is worth its price."""
    found = connections(np.array([[True, False]]), np.array([1e-9, 0.0]), np.array([0.0, 1.0]), 1.0)
    assert found.terms == (((0, False),),)
