"""Places and their bounds, flagged by bits, must be what steps make of flags one by one."""

import numpy as np
from tests.search.planted_families import planted
from tests.search.test_sequence import random_sequence

from imdim.search.bits import pack_words, unpack_words
from imdim.search.look_kernels import list_gaps, set_bounds
from imdim.search.sequence import gaps

CODES = {"union": 0, "difference": 1, "intersection": 2}


def test_gaps_are_those_of_flags():
    families, rng = planted("countersink"), np.random.default_rng(5)
    gain, m = families.cells.gain, len(families.cells.points)
    for length in (0, 1, 6):
        sequence = random_sequence(families, length, rng)
        terms = np.array([step.term.bits for step in sequence], np.uint64).reshape(len(sequence), -(-m // 64))
        empty, held, differs, won = list_gaps(terms, np.array([CODES[step.op] for step in sequence], np.int64), gain)
        behind = None
        for position, state, free in gaps(sequence, m):
            now = free & ~state, free & state
            assert np.array_equal(unpack_words(empty[position], m), now[0])
            assert np.array_equal(unpack_words(held[position], m), now[1])
            assert won[position] == gain[now[1]].sum()
            expected = [behind is None or not np.array_equal(a, b) for a, b in zip(now, behind or now, strict=True)]
            assert differs[position].tolist() == expected
            behind = now


def test_bounds_grow_by_what_may_be_added():
    rng = np.random.default_rng(6)
    gain, (before, now) = rng.integers(-9, 9, 90).astype(float), rng.random((2, 90)) < 0.5
    for sign in (1.0, -1.0):
        caps = np.array([[3.0, 0.5]])
        set_bounds(pack_words(now)[None], pack_words(before)[None], caps, np.array([sign]), gain)
        added = np.maximum(sign * gain[now & ~before], 0).sum() + np.maximum(-sign * gain[before & ~now], 0).sum()
        assert caps.tolist() == [[3.0 + added, 0.5 + added]]
