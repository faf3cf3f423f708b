"""Prefixes of samples that a policy is to mend: what is wrong in them, where, and what it sees of them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import KDTree
from tests.data.folders import make_folder

from imdim.data.canonical import canonical_primitives
from imdim.data.families import PLAIN
from imdim.data.folder import FolderConfig
from imdim.data.npz import read_sample
from imdim.data.solids import (
    BOX,
    CYLINDER,
    EXTRUDE,
    PAD,
    REVOLVE,
    SIGN,
    adds_primitive,
    from_sequences,
    holds,
    inside,
    to_sequences,
    to_signed,
)
from imdim.data.surfaces import surface_clouds
from imdim.data.synthesize import APPEND, SynthesisConfig, draw_programs, estimate_iou, with_prefixes
from imdim.geometry import kernels
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.learn.decode import apply_move, takes_back
from imdim.learn.policy import Move
from imdim.program.sequence import to_program
from imdim.program.state import END, UNDO_LAST

CONFIG = SynthesisConfig(gt_points=128, cur_points=64, n_min=2, n_max=5, volume_samples=512)


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


@pytest.fixture(scope="module")
def drawn():
    """Clouds and true sequences of 48 programs of all families."""
    solids, clouds = draw_programs(48, CONFIG, generator())
    return clouds, *to_sequences(solids, CONFIG.n_max + 1)


def samples_of(drawn, **changes):
    clouds, tokens, params = drawn
    return with_prefixes(clouds, tokens, params, replace(CONFIG, **changes), generator(1))


def true_move(samples):
    tokens, part = samples.following
    return Move(tokens, part, torch.zeros(len(tokens)), samples.at)


def same(one, other):
    """Rows [b] whose columns are the same numbers, as far as both are wide."""
    width = min(one.kinds.shape[1], other.kinds.shape[1])
    alike = torch.ones(len(one.kinds), width, dtype=torch.bool)
    for name in ("kinds", "positive", "common", "forms"):
        alike &= getattr(one, name)[:, :width] == getattr(other, name)[:, :width]
    for name in ("centers", "sizes", "shares"):
        alike &= torch.isclose(getattr(one, name)[:, :width], getattr(other, name)[:, :width], atol=1e-5).all(-1)
    return alike | ~(one.present[:, :width] | other.present[:, :width])


def test_the_true_move_puts_the_right_primitive_in_its_place(drawn):
    """After it the prefix is that of the true program, as long as before; one primitive alone was wrong."""
    _, tokens, params = drawn
    samples = samples_of(drawn, p_replace=1.0)
    replaced = samples.at != APPEND
    assert torch.equal(replaced, samples.steps > 0)
    assert ((samples.at < samples.steps) | ~replaced).all()
    assert takes_back(true_move(samples))[replaced].all()
    after = apply_move(samples.written, true_move(samples))
    column = torch.arange(tokens.shape[1])
    truth = from_sequences(torch.where(column < samples.steps[:, None], tokens, PAD), params)
    assert torch.equal(after.lengths[replaced], samples.steps[replaced])
    assert same(after, truth)[replaced].all()
    wrong = ~same(samples.written, truth)[replaced]
    assert (wrong.sum(1) <= 1).all()
    assert (wrong.sum(1) == 1).float().mean() > 0.95
    at = samples.at[replaced]
    assert (wrong.int().argmax(1) == at)[wrong.any(1)].all()
    # which place is wrong is anyone's guess
    assert len(at.unique()) >= 3
    assert 0.2 < float((at == samples.steps[replaced] - 1).float().mean()) < 0.9


def test_what_comes_after_a_replacement_is_the_rest_of_the_program(drawn):
    """One column wider; the true tokens in their order, with the right primitive once more behind the prefix."""
    _, tokens, params = drawn
    samples = samples_of(drawn, p_replace=1.0)
    assert samples.gt_tokens.shape[1] == tokens.shape[1] + 1
    for row in range(len(tokens)):
        steps, at = int(samples.steps[row]), int(samples.at[row])
        known, numbers = tokens[row].tolist(), params[row]
        mine = samples.gt_tokens[row].tolist()
        if at == APPEND:
            assert mine == [*known, PAD]
            continue
        assert mine[:at] + mine[at + 1 : steps] == known[:at] + known[at + 1 : steps]
        assert mine[steps:] == [known[at], *known[steps:]]
        assert torch.equal(samples.gt_params[row, steps], numbers[at])
        assert torch.equal(samples.gt_params[row, steps + 1 :], numbers[steps:])
        assert (samples.gt_params[row, mine.index(PAD) if PAD in mine else len(mine) :] == 0).all()


def test_a_wrong_primitive_is_united_cut_or_intersected_with_as_the_right_one(drawn):
    """The first one stays positive, and a plainer one fills the same room with a box or a cylinder."""
    _, tokens, params = drawn
    samples = samples_of(drawn, p_replace=1.0)
    rows = (samples.at != APPEND).nonzero()[:, 0]
    at = samples.at[rows]
    right, wrong = params[rows, at], samples.gt_params[rows, at]
    assert torch.equal(right[:, [SIGN, -1]], wrong[:, [SIGN, -1]])
    opened = samples.written.present[:, 0]
    assert samples.written.positive[opened, 0].all()
    kind = tokens[rows, at]
    other = samples.gt_tokens[rows, at] != kind
    assert other.float().mean() > 0.3
    plainer = samples.gt_tokens[rows, at][other & (wrong[:, :3] == right[:, :3]).all(1)]
    assert len(plainer) > 5
    assert torch.isin(plainer, torch.tensor([BOX, CYLINDER])).all()
    one, two = (
        from_sequences(t[:, None], torch.where(torch.arange(15) == SIGN, 1.0, torch.where(torch.arange(15) == 14, 0.0, p))[:, None])
        for t, p in ((kind, right), (samples.gt_tokens[rows, at], wrong))
    )
    near = estimate_iou(one, two, 2000, generator())
    assert float(near.median()) > 0.4


@pytest.mark.parametrize("families", [PLAIN, ("profile", "ring", "common")], ids=["plain", "wide"])
def test_wrong_primitives_have_canonical_numbers(families):
    """A policy's own are: it never sees others of what it has written."""
    solids, clouds = draw_programs(64, replace(CONFIG, families=families), generator())
    samples = samples_of((clouds, *to_sequences(solids, CONFIG.n_max + 1)), p_replace=1.0)
    written = samples.written
    again = canonical_primitives(written)
    there = written.present
    assert torch.equal(again.forms[there], written.forms[there])
    for name in ("sizes", "rotations", "shares"):
        off = (getattr(again, name) - getattr(written, name)).abs().flatten(2).amax(2)[there]
        assert (off < 1e-3).all(), f"{name}: {int((off > 1e-3).sum())} of {len(off)}"


@pytest.mark.parametrize("changes", [{}, {"p_shaken": 1.0}, {"p_replace": 1.0}, {"p_undo": 1.0}], ids=str)
def test_clouds_of_prefixes_show_what_is_wrong_in_them(changes):
    """Against the exact solid of each prefix: on its surface, and no large part of it without a point. Of programs with outlines alone."""
    config = replace(CONFIG, families=("profile", "ring"), n_min=1, n_max=2)
    solids, clouds = draw_programs(20, config, generator(2))
    samples = samples_of((clouds, *to_sequences(solids, config.n_max + 1)), cur_points=600, **changes)
    shown = 0
    for row, sequence in enumerate(to_signed(samples.written)):
        if not sequence:
            assert not samples.cur_points[row].any()
            continue
        program = to_program(sequence)
        points = samples.cur_points[row].double().numpy()
        mesh = to_trimesh(to_manifold(program))
        assert np.abs(kernels.program_sdf(program, points)).max() < 2e-4
        gaps = KDTree(points).query(trimesh.sample.sample_surface(mesh, 400, seed=0)[0])[0]
        assert np.quantile(gaps, 0.99) < 5 * np.sqrt(mesh.area / 600), f"row {row}"
        shown += 1
    assert shown > 8


def test_a_shaken_polygon_is_the_same_for_points_and_programs():
    """Its box stays square, or else its quarter turns would not have the corners that its cloud shows."""
    config = replace(CONFIG, families=("profile",), n_min=1)
    solids, clouds = draw_programs(60, config, generator(3))
    samples = samples_of((clouds, *to_sequences(solids, config.n_max + 1)), p_shaken=1.0, shake=0.05)
    points = torch.rand(60, 500, 3, generator=generator(4)) * 1.2 - 0.6
    mine = inside(samples.written, holds(samples.written, points))
    for row, sequence in enumerate(to_signed(samples.written)):
        if sequence:
            values = kernels.program_sdf(to_program(sequence), points[row].double().numpy())
            assert (mine[row].numpy() == (values < 0))[np.abs(values) > 1e-5].all(), f"row {row}"


def test_mistakes_that_are_taken_back_are_replaced_by_nothing(drawn):
    samples = samples_of(drawn, p_undo=0.5, p_replace=1.0, p_hidden=1.0)
    tokens, _ = samples.following
    back = tokens == int(UNDO_LAST)
    assert 0.3 < float(back.float().mean()) < 0.7
    assert (samples.at[back] == APPEND).all()
    assert (samples.at != APPEND).any()
    # a solid that was to be mended in one place must be known by its parts
    assert torch.equal(samples.hidden, samples.at == APPEND)
    assert samples.gt_tokens.shape[1] == drawn[1].shape[1] + 3
    assert ((samples.gt_tokens == END).sum(1) == 1).all()


def test_shares_of_wrong_and_hidden_prefixes_are_those_of_the_settings():
    solids, clouds = draw_programs(16, replace(CONFIG, gt_points=16), generator())
    rows = torch.arange(1600) % 16
    tokens, params = to_sequences(solids, CONFIG.n_max + 1)
    many = clouds[rows, :8], tokens[rows], params[rows]
    samples = samples_of(many, cur_points=4, p_replace=0.3, p_hidden=0.4)
    some = samples.steps > 0
    assert float((samples.at != APPEND)[some].float().mean()) == pytest.approx(0.3, abs=0.05)
    assert float(samples.hidden[samples.at == APPEND].float().mean()) == pytest.approx(0.4, abs=0.05)
    neither = samples_of(many, cur_points=4)
    assert not neither.hidden.any()
    assert (neither.at == APPEND).all()
    assert torch.equal(neither.gt_tokens, many[1])


def test_hidden_prefixes_are_drawn_and_shown_as_others(drawn):
    """Only what a policy is to see of them changes, not what they are."""
    plain, hidden = (samples_of(drawn, p_hidden=p) for p in (1e-9, 1.0))
    assert hidden.hidden.all()
    for name in ("gt_tokens", "gt_params", "steps", "at"):
        assert torch.equal(getattr(plain, name), getattr(hidden, name))
    assert torch.equal(plain.cur_points, hidden.cur_points)
    again = surface_clouds(hidden.written, CONFIG.cur_points, generator())[0]
    assert torch.equal(again.flatten(1).any(1), hidden.steps > 0)


def test_files_have_no_primitive_in_the_place_of_another(tmp_path):
    """A file has no word for it: all its primitives are those of the true program."""
    small = replace(CONFIG, gt_points=32, cur_points=16, n_min=1, n_max=3, volume_samples=256, prefixes=4)
    written = []
    for name, p in (("plain", 0.0), ("replaced", 1.0)):
        config = FolderConfig(str(tmp_path / name), 6, 1, 3, replace(small, p_replace=p))
        list(make_folder(config))
        written.append([read_sample(path) for path in sorted((tmp_path / name).rglob("*.npz"))])
    for one, other in zip(*written, strict=True):
        assert all((one[field] == other[field]).all() for field in one)
        tokens = torch.tensor(one["gt_tokens"])
        assert adds_primitive(tokens[:-1]).all()


def test_some_prefixes_have_outlines(drawn):
    """Else nothing here is tested."""
    _, tokens, params = drawn
    assert (tokens == EXTRUDE).any()
    assert (tokens == REVOLVE).any()
    assert (params[..., -1] > 0).any()
