"""Measurements against answers whose worth is known in closed form."""

import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from imdim.data.solids import EXTRUDE, REVOLVE, from_sequences
from imdim.data.synthesize import APPEND, SynthesisConfig, synthesize
from imdim.learn.checkpoint import save_net
from imdim.learn.measure import errors_by_kind, exact_structure, moves, summary
from imdim.learn.policy import Move
from imdim.learn.policy_net import BaseConfig, BasePolicy
from imdim.program.state import ADD_BOX, ADD_CYLINDER, ADD_SPHERE, END
from imdim.program.tree import Primitive

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))

from evaluate import bounding_boxes, exact_iou, main, written_programs

SMALL = BaseConfig(d_model=16, encoder_layers=1, decoder_layers=1, heads=2, gt_points=64, cur_points=32)


def one(token, numbers):
    return from_sequences(torch.tensor([[int(token)]]), torch.tensor([[[*numbers, 1.0]]], dtype=torch.float32))


def test_iou_counts_failures_and_is_exact():
    cube, half = Primitive("box", (1.0, 1.0, 1.0)), Primitive("box", (0.5, 1.0, 1.0))
    assert exact_iou(half, cube) == pytest.approx(0.5)
    assert exact_iou(None, cube) == 0.0
    assert summary([0.0, 0.5, 0.95, 1.0]) == {"median": pytest.approx(0.725), "mean": pytest.approx(0.6125), "share_090": 0.5}


def test_the_box_of_a_ball_is_worth_pi_sixths():
    u = torch.randn(1, 20_000, 3, generator=torch.Generator().manual_seed(0))
    ball = torch.nn.functional.normalize(u, dim=-1) * 0.5
    found = written_programs(bounding_boxes(ball))[0]
    assert exact_iou(found, Primitive("sphere", (0.5,))) == pytest.approx(math.pi / 6, abs=0.01)


def test_errors_are_those_that_were_planted():
    """A cylinder turned end over end and spun is the same; one tilted by 30 degrees, longer by 0.1 and moved by 0.2 is not."""
    batch = synthesize(3, SynthesisConfig(gt_points=32, cur_points=16, n_max=1, volume_samples=256), torch.Generator().manual_seed(0))
    rows = [(0, 0, 0, 0.2, 0.5, 0, 0, 0, 0), (0, 0, 0, 0.2, 0.5, 0, 0, 0, 0), (0, 0, 0, 0.3, 0.5, 0.7, 0, 0, 0)]
    tokens = torch.tensor([[ADD_CYLINDER, END], [ADD_CYLINDER, END], [ADD_BOX, END]]).int().long()
    params = torch.zeros(3, 2, 10)
    params[:, 0, :9] = torch.tensor(rows)
    batch = batch._replace(gt_tokens=tokens, gt_params=params, steps=torch.zeros(3, dtype=torch.long))
    found = [(0, 0, 0, 0.2, 0.5, 0, 180, 0, 40), (0, 0, 0.2, 0.2, 0.6, 0, 30, 0, 0), (0, 0, 0, 0.3, 0.5, 0.7, 0, 0, 180)]
    parts = [one(t, n) for t, n in zip(tokens[:, 0], found, strict=True)]
    part = type(parts[0])(*(torch.cat([getattr(p, f) for p in parts]) for f in type(parts[0]).__dataclass_fields__))
    errors = errors_by_kind(batch, Move(tokens[:, 0], part, torch.zeros(3), torch.full((3,), APPEND)))
    second = errors_by_kind(
        type(batch)(*(v[1:2] for v in batch)), Move(tokens[1:2, 0], part[1:2], torch.zeros(1), torch.full((1,), APPEND))
    )["cylinder"]
    assert (errors["cylinder"].count, errors["box"].count, errors["sphere"].count) == (2, 1, 0)
    assert errors["box"].angle_deg == pytest.approx(0.0, abs=0.05)
    assert (second.center, second.size, second.angle_deg) == (pytest.approx(0.2), pytest.approx(0.1), pytest.approx(30.0, abs=0.05))
    assert errors["cylinder"].angle_deg == pytest.approx(0.0, abs=0.05)  # torch's median of two is the lower one
    assert math.isnan(errors["sphere"].center)


def test_errors_of_outlines_are_those_that_were_planted():
    """A spin is an error of what is extruded and none of what is turned; a tilt is one of both."""
    batch = synthesize(4, SynthesisConfig(gt_points=32, cur_points=16, n_max=1, volume_samples=256), torch.Generator().manual_seed(0))
    tokens = torch.tensor([[EXTRUDE, END], [REVOLVE, END]] * 2)
    params = torch.zeros(4, 2, 15)
    params[:, 0, 3:6], params[:, 0, 9:13] = torch.tensor([0.3, 0.5, 0.4]), torch.tensor([1.0, 21.0, 0.2, 0.3])
    batch = batch._replace(gt_tokens=tokens, gt_params=params, steps=torch.zeros(4, dtype=torch.long), at=torch.full((4,), APPEND))
    found = params[:, :1].clone()
    found[:2, 0, 8], found[2:, 0, 6] = 20.0, 30.0
    move = Move(tokens[:, 0], from_sequences(tokens[:, :1], found), torch.zeros(4), torch.full((4,), APPEND))
    for rows, spun in ((slice(0, 2), True), (slice(2, 4), False)):
        some = torch.arange(4)[rows]
        errors = errors_by_kind(type(batch)(*(v[rows] for v in batch)), move.of(some))
        assert (errors["extrude"].count, errors["revolve"].count, errors["box"].count) == (1, 1, 0)
        assert errors["extrude"].angle_deg == pytest.approx(20.0 if spun else 30.0, abs=0.05)
        assert errors["revolve"].angle_deg == pytest.approx(0.0 if spun else 30.0, abs=0.05)


def test_structure_is_kinds_signs_and_forms():
    a, b = one(ADD_BOX, (0, 0, 0, 1, 1, 1, 0, 0, 0)), one(ADD_BOX, (0, 0, 0.3, 0.2, 1, 1, 0, 0, 0))
    ball = one(ADD_SPHERE, (0, 0, 0, 1, 1, 1, 0, 0, 0))
    assert bool(exact_structure(a, b)[0])
    assert not bool(exact_structure(a, ball)[0])
    ell, tee = (replace(a, kinds=torch.tensor([[EXTRUDE]]), forms=torch.tensor([[form]])) for form in (21, 25))
    assert bool(exact_structure(ell, replace(ell, shares=ell.shares + 0.2))[0])
    assert not bool(exact_structure(ell, tee)[0])


def test_moves_in_a_mixed_batch_are_those_of_each_row_alone():
    """Rows of other kinds use other slots; none may change what a row writes."""
    torch.manual_seed(0)
    batch = synthesize(6, SynthesisConfig(gt_points=64, cur_points=32, n_max=4, volume_samples=256), torch.Generator().manual_seed(0))
    policy = BasePolicy(SMALL, 6).eval()
    with torch.no_grad():
        policy.to_bins.mul_(20)  # decided, so that rounding cannot choose
    together = moves(policy, batch)[0]
    for row in range(6):
        alone = moves(policy, type(batch)(*(v[row : row + 1] for v in batch)))[0]
        assert alone.tokens[0] == together.tokens[row]
        assert torch.allclose(alone.part.centers[0], together.part.centers[row], atol=1e-4)
        assert torch.allclose(alone.log_p[0], together.log_p[row], atol=1e-3)


def test_the_script_measures_a_checkpoint_and_refuses_none(tmp_path, capsys):
    save_net(tmp_path / "a.safetensors", BasePolicy(SMALL, 5), {})
    small = [
        "synthesis.gt_points=64",
        "synthesis.cur_points=32",
        "synthesis.n_max=3",
        "decode.beam=2",
        "decode.points=32",
        "decode.cur_points=32",
    ]
    arguments = [f"checkpoint={tmp_path / 'a.safetensors'}", "n=4", "first=2", f"out={tmp_path / 'out.json'}", *small]
    said: list[str] = []
    assert main(arguments, said.append) == 0
    results = json.loads((tmp_path / "out.json").read_text())
    answers = results["1-3"]["answers"]
    assert list(answers) == ["bounding box", "bounding box + solver", "greedy", "beam 2", "beam 2 + solver"]
    assert all(len(answer["ious"]) == 2 for answer in answers.values())
    assert any("| beam 2 |" in line for line in said)
    assert main([f"checkpoint={tmp_path / 'none'}"], said.append) == 2
    assert "no checkpoint at" in capsys.readouterr().err
