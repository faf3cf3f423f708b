"""Batched scores against a plain reading of their definition, a tree at a time."""

import numpy as np
import pytest
from program_samples import cloud, random_program

from imdim.geometry.kernels import program_sdf
from imdim.program.tree import Combine, Primitive, leaves
from imdim.search.front.fitness import FitnessConfig, SampledTarget, Scorer


def evidence(samples: int = 700) -> SampledTarget:
    rng = np.random.default_rng(0)
    points, weights = cloud(rng, samples), rng.random(samples)
    inside = np.linalg.norm(points, axis=1) < 0.9
    return SampledTarget(cloud(rng, 300), 2.5, points, weights * inside, weights * ~inside)


def plain(program, known: SampledTarget, config: FitnessConfig) -> tuple[float, float]:
    inside = program_sdf(program, known.samples) < 0
    volume = known.w_out[inside].sum() + known.w_in[~inside].sum()
    cap = config.cap * np.linalg.norm(np.ptp(known.surface, axis=0))
    distance = np.minimum(np.abs(program_sdf(program, known.surface)), cap).mean() * known.area
    return volume / known.w_in.sum(), distance / known.w_in.sum()


def test_scores_are_what_they_say():
    known, config, rng = evidence(), FitnessConfig(size_weight=1e-2, cap=0.05, capacity=64), np.random.default_rng(1)
    programs = [random_program(rng, int(rng.integers(1, 20)), reuse=0.2) for _ in range(60)]
    for program, score in zip(programs, Scorer(known, config).score(programs), strict=True):
        volume, distance = plain(program, known, config)
        assert score.volume == pytest.approx(volume, abs=1e-6)
        assert score.distance == pytest.approx(distance, abs=1e-5)
        assert score.error == pytest.approx(volume + config.distance_weight * distance, abs=1e-5)
        assert score.primitives == len(list(leaves(program)))
        assert score.fitness == pytest.approx(score.error + 1e-2 * score.primitives)


def test_scores_do_not_depend_on_the_company():
    known, rng = evidence(), np.random.default_rng(2)
    programs = [random_program(rng, 8) for _ in range(40)]
    together = Scorer(known, FitnessConfig(capacity=4)).score(programs)
    crowded = Scorer(known, FitnessConfig(capacity=4))
    assert [crowded.score([p])[0] for p in programs] == together


def test_a_deep_chain_is_scored():
    part = Primitive("sphere", (0.5,))
    program = part
    for i in range(3000):
        program = Combine("union", Primitive("sphere", (0.5,), (1e-4 * i, 0.0, 0.0)), program)
    assert Scorer(evidence()).score([program])[0].primitives == 3001


def test_the_same_solid_in_another_order_is_folded_once():
    a, b, c = (Primitive("box", (0.3, 0.4, 0.1 * i)) for i in (1, 2, 3))
    scorer = Scorer(evidence())
    first, second = Combine("difference", Combine("union", a, b), c), Combine("difference", Combine("union", b, a), c)
    assert scorer.key(first) == scorer.key(second)
    assert scorer.key(first) != scorer.key(Combine("difference", c, Combine("union", a, b)))
    scorer.score([first, second, first])
    scorer.score([second])
    assert scorer.evaluations == 1


def test_without_samples_distances_alone_count():
    known = SampledTarget(cloud(np.random.default_rng(0), 300), 2.0)
    score = Scorer(known).score([Primitive("sphere", (0.7,))])[0]
    assert score.volume == 0
    assert score.error == score.distance > 0
    diagonal = np.linalg.norm(np.ptp(known.surface, axis=0))
    expected = np.minimum(np.abs(np.linalg.norm(known.surface, axis=1) - 0.7), 0.02 * diagonal).mean() * 2.0 / diagonal**3
    assert score.distance == pytest.approx(expected, rel=1e-4)
