"""Rows against the double-precision leaf table, also when they are displaced."""

import numpy as np
import pytest
from program_samples import cloud, inside_primitive, random_primitive
from tests.drawn import BRACKET, PULLEY, centred

from imdim.geometry.kernels import leaf_table
from imdim.geometry.lowering import Outlines, pack
from imdim.program.outline import Outline, rectangle
from imdim.program.tree import OUTLINED, SIMPLE, Primitive, map_lengths
from imdim.search.bits import pack_words, unpack_words
from imdim.search.front.leaf_cache import LeafCache, Registry


def truth(primitives: list[Primitive], points: np.ndarray) -> np.ndarray:
    kinds, params = zip(*(pack(p) for p in primitives), strict=True)
    return leaf_table(np.concatenate(kinds), np.concatenate(params), points, Outlines.of(primitives))


def some(count: int, seed: int = 0) -> list[Primitive]:
    rng = np.random.default_rng(seed)
    return [random_primitive(rng) for _ in range(count)]


def test_every_kind_agrees_with_the_leaf_table():
    parts, points = some(120), cloud(np.random.default_rng(1), 1000)
    assert {p.kind for p in parts} == set(SIMPLE)
    columns = LeafCache(points, "distances", Registry(), 200)
    assert np.abs(columns.of(parts) - truth(parts, points)).max() < 3e-6


@pytest.mark.parametrize("count", [1, 63, 64, 1000])
def test_bits_agree_with_the_equations(count):
    parts, points = some(40), cloud(np.random.default_rng(2), count)
    columns = LeafCache(points, "bits", Registry(), 64)
    flags = unpack_words(columns.of(parts), columns.count)
    expected = np.array([inside_primitive(p, points) for p in parts])
    unsure = np.abs(truth(parts, points)) < 1e-5
    assert flags.shape == (40, count)
    assert ((flags == expected) | unsure).all()
    # what pads the last word is inside of nothing
    assert np.bitwise_count(columns.of(parts)).sum() == flags.sum()


def test_displaced_rows_come_back_right():
    parts, points = some(60), cloud(np.random.default_rng(3), 200)
    columns = LeafCache(points, "distances", Registry(), 16)
    expected, rng = truth(parts, points), np.random.default_rng(4)
    for _ in range(60):
        chosen = rng.choice(60, 10)
        assert np.abs(columns.of([parts[i] for i in chosen]) - expected[chosen]).max() < 3e-6
    assert len(columns) == len(columns.table) == 16


def test_the_least_recently_used_goes():
    parts, points = some(5), cloud(np.random.default_rng(3), 8)
    columns = LeafCache(points, "distances", Registry(), 4)
    for part in [*parts[:4], parts[0]]:
        columns.of([part])
    columns.table[:] = 7.0  # a row that is computed anew loses this
    columns.of(parts[4:])
    assert [bool((columns.of([p]) == 7.0).all()) for p in parts[:4]] == [True, False, False, False]


def test_more_at_once_than_there_is_room_for():
    parts, points = some(40), cloud(np.random.default_rng(3), 50)
    columns = LeafCache(points, "distances", Registry(), 8)
    columns.of(parts[:6])
    assert np.abs(columns.of(parts) - truth(parts, points)).max() < 3e-6


def test_equal_primitives_share_a_row():
    columns = LeafCache(np.zeros((3, 3)), "distances", Registry())
    columns.of([some(1)[0], some(1)[0]])
    assert len(columns) == 1


def test_packing_is_undone_by_unpacking():
    flags = np.random.default_rng(0).random(150) < 0.5
    assert np.array_equal(unpack_words(pack_words(flags), 150), flags)


@pytest.mark.parametrize("content", ["distances", "bits"])
def test_outlines_share_the_table_with_the_others(content):
    points = cloud(np.random.default_rng(6), 1000)
    drawn = [map_lengths(leaf, lambda length: length / 60, (0.1, 0.2, -0.1)) for leaf in (centred(BRACKET, 30.0), PULLEY)]
    drawn.append(Primitive("drafted", (0.5, 6.0), (0.1, 0.2, 0.0), (10.0, 20.0, 30.0), Outline(rectangle(0.9, 0.7).loops)))
    parts = [*some(3), drawn[0], *some(2, seed=1), *drawn[1:]]
    assert {p.kind for p in drawn} == set(OUTLINED)
    columns = LeafCache(points, content, Registry(), 16)
    if content == "distances":
        assert np.abs(columns.of(parts) - truth(parts, points)).max() < 3e-6
        return
    flags, expected = unpack_words(columns.of(parts), columns.count), truth(parts, points)
    assert flags[3].sum() > 5
    assert ((flags == (expected < 0)) | (np.abs(expected) < 1e-5)).all()
