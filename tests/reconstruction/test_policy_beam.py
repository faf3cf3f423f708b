"""Policies in the pipeline: clouds in any pose and unit, scripted programs, checkpoints that are none."""

import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from tests.planted import PARTS, box, common, cut, cylinder, mesh_of, sphere, union

from imdim.data.outlines import Family, family_of, form_of
from imdim.data.solids import BOX, CYLINDER, EXTRUDE, SPHERE, Solids, from_sequences
from imdim.data.synthesize import APPEND
from imdim.deadline import NEVER
from imdim.geometry import kernels
from imdim.geometry.axes import main_axes
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.learn.checkpoint import save_net
from imdim.learn.decode import DecodeConfig
from imdim.learn.policy import Move, Policy
from imdim.learn.policy_net import BaseConfig, BasePolicy
from imdim.program.outline import Outline, rectangle
from imdim.program.sequence import to_program, to_sequence
from imdim.program.state import END
from imdim.program.tree import Combine, Primitive
from imdim.reconstruction import methods, pipeline
from imdim.reconstruction.config import ConfigError, Settings
from imdim.reconstruction.mdl import most_likely
from imdim.reconstruction.observation import UnitBody, observe
from imdim.reconstruction.policy_beam import ASKED, decode_sequences, load, load_if_any, misfit, next_parts, proposals
from imdim.search.mdl.primitive_selection import Cloud
from imdim.target.target import in_unit_frame, sample_surface, target_from

ROOT = Path(__file__).parents[2]
TINY = BaseConfig(d_model=16, encoder_layers=1, decoder_layers=1, heads=2, gt_points=64, cur_points=32, point_width=8)


class Script(Policy):
    """Writes the box of the cloud that it sees, then, if asked, a bore along its longest edge; then ends."""

    max_seq_len = 4

    def __init__(self, bore: float = 0.0) -> None:
        super().__init__()
        self.bore = bore

    def losses(self, batch):
        raise NotImplementedError

    def propose(self, seen, generator=None, ways=1):
        gt_points, lengths = seen.gt_points.repeat_interleave(ways, 0), seen.written.lengths.repeat_interleave(ways)
        low, high = gt_points.amin(1), gt_points.amax(1)
        first, more = lengths == 0, (lengths == 1) & (self.bore > 0)
        tokens = torch.where(first, BOX, torch.where(more, CYLINDER, int(END)))
        bore = torch.tensor([self.bore, 2.0, 0.0]).expand_as(low)
        sizes = torch.where(first[:, None], high - low, bore)
        k = (high - low).argmin(1)
        turn = torch.stack([torch.eye(3), torch.eye(3).roll(1, 1), torch.eye(3)])
        turn[0] = torch.tensor([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
        turn[1] = torch.tensor([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
        rotations = torch.where(first[:, None, None], torch.eye(3), turn[k])
        part = Solids.plain(tokens[:, None], first[:, None], ((low + high) / 2)[:, None], sizes[:, None], rotations[:, None])
        return Move(tokens, part, torch.zeros(len(tokens)), torch.full_like(tokens, APPEND))


def cloud(program, seed=0, n=3000):
    mesh = mesh_of(program)
    return sample_surface(mesh.vertices, mesh.faces, n, np.random.default_rng(seed))[0]


def iou(found, truth):
    return volume_iou(to_manifold(found), to_manifold(truth))


def test_a_policy_is_asked_for_more_in_the_pose_and_units_of_a_program():
    """It sees a primitive as what it wrote before, also one that is drawn as a rectangle, and any other outline by its solid alone, before
    which it begins anew."""
    pose = (25.0, -40.0, 70.0)
    block = box(300, 200, 80, (1000.0, -50.0, 7.0), pose)
    truth = cut(block, cylinder(40, 200, (1000.0, -50.0, 7.0), pose))
    plain = Primitive("extrude", (80.0,), (1000.0, -50.0, 7.0), pose, rectangle(300.0, 200.0))
    chamfered = Outline(((*rectangle(300.0, 200.0).rings[0][:3], (-140.0, 100.0, 0.0), (-150.0, 90.0, 0.0)),))
    drawn = replace(plain, outline=chamfered)
    points = cloud(truth)
    bore = 0.1 * float(np.linalg.norm([300, 200, 80]))
    expected = cut(block, cylinder(bore, 200, (1000.0, -50.0, 7.0), pose))
    after, also, anew = (next_parts(Script(bore=0.1), points, p) for p in (block, plain, drawn))
    assert len(after) == len(also) == len(anew) == ASKED
    assert all(isinstance(p, Primitive) and p.kind == "cylinder" and iou(cut(block, p), expected) >= 0.98 for p in {*after, *also})
    assert all(isinstance(p, Primitive) and p.kind == "box" and iou(p, block) >= 0.98 for p in set(anew))


class Told(Policy):
    """Writes given steps (token, fifteen numbers in the frame of its cloud) one after another, whatever it sees, then ends; keeps what it
    saw."""

    max_seq_len = 6

    def __init__(self, *steps) -> None:
        super().__init__()
        self.given, self.seen = steps, []

    def losses(self, batch):
        raise NotImplementedError

    def log_prob(self, seen, move):
        raise NotImplementedError

    def propose(self, seen, generator=None, ways=1):
        self.seen.append(seen)
        lengths = seen.written.lengths.repeat_interleave(ways)
        tokens = torch.tensor([*(token for token, _ in self.given), int(END)])[lengths.clamp_max(len(self.given))]
        kinds = torch.where(tokens == int(END), BOX, tokens)
        numbers = torch.tensor([*(n for _, n in self.given), self.given[0][1]])[lengths.clamp_max(len(self.given))]
        part = from_sequences(kinds[:, None], numbers[:, None])
        return Move(tokens, part, torch.zeros(len(tokens)), torch.full_like(tokens, APPEND))


ELL = int(form_of(torch.tensor(int(Family.ELL)), torch.tensor(0)))
DIAGONAL = float(np.linalg.norm([60, 40, 20]))
# in the frame of a cloud of 60 by 40 by 20
WALL = EXTRUDE, [0.0, 0, 0, 60 / DIAGONAL, 40 / DIAGONAL, 20 / DIAGONAL, 0, 0, 0, 1, ELL, 0.3, 0.25, 0, 0]
BALL = SPHERE, [0.0, 0, 0, 25 / DIAGONAL, 0, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1]
BLOCK = BOX, [*WALL[1][:10], 0, 0, 0, 0, 0]


def test_outlines_and_intersections_come_back_in_the_pose_and_units_of_the_cloud():
    """An L, then what it has in common with a ball, against both written by hand."""
    place, pose = (100.0, -5.0, 7.0), (25.0, -40.0, 70.0)
    corners = (-30, -20), (30, -20), (30, -10), (-12, -10), (-12, 20), (-30, 20)
    expected = Primitive("extrude", (20.0,), place, pose, Outline((tuple((float(x), float(y), 0.0) for x, y in corners),)))
    truth = common(expected, sphere(32.0, place))
    told, config = Told(WALL, (SPHERE, [*BALL[1][:3], 32 / DIAGONAL, *BALL[1][4:]])), DecodeConfig(beam=4, cur_points=64, undo_limit=0)
    whole = decode_sequences(told, cloud(truth), matrix_from_euler(pose), config=config)[0]
    assert [(step.op, step.term.kind) for step in whole] == [("union", "extrude"), ("intersection", "sphere")]
    assert iou(whole[0].term, expected) >= 0.98
    assert iou(to_program(whole), truth) >= 0.98


def test_what_a_policy_would_intersect_with_is_offered_in_common_with_the_first_parts():
    block, stud, third = box(60, 40, 20), cylinder(8, 30), box(4, 4, 26)
    points = cloud(block)
    for program, own in ((block, [block]), (union(block, stud, third), [block, stud]), (cut(union(block, stud), third), [block, stud])):
        told = Told(BLOCK, *[BALL] * 4)
        parts = next_parts(told, points, program)
        assert len(parts) == ASKED * len(own)
        assert told.seen[0].must_add
        assert told.seen[0].may_undo.all()
        assert all(isinstance(p, Combine) and p.op == "intersection" and p.left in own for p in parts)
        assert all(iou(p, common(held, sphere(25.0))) >= 0.97 for p, held in zip(parts[: len(own)], own, strict=True))


def test_a_program_that_no_sequence_can_say_is_seen_by_its_solid_alone():
    """One that cuts an intersection, and one longer than sequences are: the cloud's points are told by how far they are outside of it."""
    block = box(60, 40, 20)
    part = cut(block, common(sphere(12.0), box(30, 6, 30)))
    points = cloud(block)
    for program in (part, union(*(box(60, 40, 20 - 0.01 * k) for k in range(8)))):
        told = Told(BLOCK)
        parts = next_parts(told, points, program)
        assert len(parts) == ASKED
        (seen,) = told.seen
        assert int(seen.written.lengths) == 0
        local = seen.gt_points[0].double().numpy() * DIAGONAL
        # the frame may be turned by half a turn, which these do not mind
        known = kernels.program_sdf(program, local) / DIAGONAL
        assert seen.outside[0].numpy() == pytest.approx(known, abs=5e-3)


def test_a_program_that_a_sequence_can_say_is_seen_step_by_step():
    """Blocks and bores, and an L as the L that it is."""
    block = box(60, 40, 20)
    points = cloud(block)
    corners = (-30, -20), (30, -20), (30, -10), (-12, -10), (-12, 20), (-30, 20)
    wall = Primitive("extrude", (20.0,), outline=Outline((tuple((float(x), float(y), 0.0) for x, y in corners),)))
    for program, kinds in ((block, [BOX]), (cut(wall, cylinder(3, 30, (-20.0, -15.0, 0.0))), [EXTRUDE, CYLINDER])):
        told = Told(*[BLOCK] * 4)
        next_parts(told, points, program)
        (seen,) = told.seen
        assert seen.outside is None
        assert seen.written.kinds.tolist() == [kinds]
        assert seen.written.positive[0].tolist() == [True, *[False] * (len(kinds) - 1)]
    assert int(family_of(seen.written.forms[0, 0])) == Family.ELL
    assert sorted(seen.written.shares[0, 0].tolist()) == pytest.approx([0.0, 0.25, 0.3], abs=1e-3)


def test_a_beam_of_intersections_leaves_the_solver_what_it_can_use():
    """It knows none: the rest of the beam, and its own primitives, explain the cloud."""
    block = box(60, 40, 20)
    points = cloud(block)
    found = proposals(Told(BLOCK, BALL), points, 0.0)
    assert iou(found[0].program, block) >= 0.98
    assert all(step.op != "intersection" for p in found for step in to_sequence(p.program))


def test_programs_come_back_in_the_pose_and_units_of_the_cloud():
    pose = (25.0, -40.0, 70.0)
    truth = cut(box(300, 200, 80, (1000.0, -50.0, 7.0), pose), cylinder(40, 200, (1000.0, -50.0, 7.0), pose))
    points = cloud(truth)
    axes = main_axes(points)
    found = decode_sequences(Script(bore=0.1), points, axes, config=DecodeConfig(beam=2, cur_points=64))
    bore = 0.1 * float(np.linalg.norm([300, 200, 80]))
    expected = cut(box(300, 200, 80, (1000.0, -50.0, 7.0), pose), cylinder(bore, 200, (1000.0, -50.0, 7.0), pose))
    assert max(iou(to_program(s), expected) for s in found) >= 0.98
    assert iou(proposals(Script(bore=0.1), points, 0.0)[0].program, truth) >= 0.99


def test_a_noisy_search_asks_what_a_policy_would_write_and_then_what_it_would_add():
    truth = cut(box(60, 40, 20), cylinder(6, 60))
    points = cloud(truth, n=1500) + np.random.default_rng(1).normal(size=(1500, 3)) * 0.4
    asked = []

    class Asked(Script):
        def propose(self, seen, generator=None, ways=1):
            asked.append(seen.must_add)
            return super().propose(seen, generator, ways)

    unit, frame = in_unit_frame(target_from(points))
    rng = np.random.default_rng(0)
    seen = observe(UnitBody.of(unit, rng), Settings().size_weight, rng)
    found = frame.undo(most_likely([Primitive("sphere", (1.0,))], seen, NEVER, policy=lambda: Asked(bore=0.07), anew=False).program)
    assert iou(found, truth) >= 0.97
    assert asked[0] is False
    assert asked[-1] is True


def test_no_policy_is_loaded_for_a_noisy_cloud_without_time_for_it(monkeypatch):
    monkeypatch.setattr(pipeline, "load_if_any", lambda _: pytest.fail("torch takes longer than what is left"))
    points = cloud(box(60, 40, 20)) + np.random.default_rng(1).normal(size=(3000, 3)) * 0.4
    *_, last = pipeline.reconstruct(target_from(points), Settings(budget_s=6.0), np.random.default_rng(0), time.process_time)
    assert iou(last.program, box(60, 40, 20)) >= 0.95
    assert last.stop == methods.CUT


def test_stray_points_do_not_move_the_box_that_a_policy_measures_by():
    truth = cut(box(60, 40, 20), cylinder(8, 60))
    points = cloud(truth, n=4000)
    stray = np.random.default_rng(1).uniform(-60, 60, (60, 3))
    assert iou(proposals(Script(), np.concatenate([points, stray]), 0.0)[0].program, truth) >= 0.98


def test_misfit_orders_programs_by_what_they_get_wrong():
    truth = PARTS["L bracket"]
    seen = Cloud.of(cloud(truth, n=2048), 0.0)
    half, whole, more = truth.left, truth, union(truth, box(20, 20, 20, (40.0, 40.0, 40.0)))
    costs = [misfit(p, seen) for p in (whole, more, half)]
    assert costs == sorted(costs)
    assert costs[0] < 0.1 < 0.3 < costs[2]
    assert misfit(cut(box(1, 1, 1), box(2, 2, 2)), seen) > 1


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    torch.manual_seed(0)
    path = tmp_path_factory.mktemp("models") / "tiny.safetensors"
    save_net(path, BasePolicy(TINY, 4), {})
    return str(path)


def test_the_policy_alone_explains_a_mesh_and_a_cloud(checkpoint):
    part = cut(box(60, 40, 20), cylinder(8, 60))
    for target in (target_from(mesh_of(part)), target_from(cloud(part, n=4000))):
        run = list(pipeline.reconstruct(target, Settings(method="policy", checkpoint=checkpoint), np.random.default_rng(0)))
        assert run[0].stage == "policy"
        assert "search" not in {s.stage for s in run}
        assert volume_iou(to_manifold(run[-1].program), mesh_to_manifold(mesh_of(part))) >= 0.98


def test_auto_takes_a_policy_for_clouds_and_is_none_the_worse(checkpoint, monkeypatch):
    asked = []
    monkeypatch.setattr(methods, "POOR", -1.0)
    monkeypatch.setattr(pipeline, "load_if_any", lambda path: asked.append(path) or Script())
    part = cut(box(60, 40, 20), cylinder(8, 60))
    *_, last = pipeline.reconstruct(target_from(cloud(part, n=4000)), Settings(checkpoint="x"), np.random.default_rng(0))
    assert asked == ["x"]
    assert iou(last.program, part) >= 0.98
    list(pipeline.reconstruct(target_from(mesh_of(part)), Settings(), np.random.default_rng(0)))
    assert asked == ["x"]


def test_auto_does_without_torch_and_says_so(monkeypatch):
    monkeypatch.setattr(methods, "POOR", -1.0)
    monkeypatch.setattr(pipeline, "lacking", lambda *modules: ["torch"])
    monkeypatch.setattr("imdim.reconstruction.policy_beam.lacking", lambda *modules: ["torch"])
    part = cut(box(60, 40, 20), cylinder(8, 60))
    *_, last = pipeline.reconstruct(target_from(cloud(part, n=4000)), Settings(), np.random.default_rng(0))
    assert iou(last.program, part) >= 0.98
    assert [note for note in last.notes if "for lack of torch" in note] == [last.notes[0]]


def seen_of(points):
    rng = np.random.default_rng(0)
    return observe(UnitBody.of(target_from(points), rng), 2.5e-4, rng)


def test_what_fits_far_better_replaces_what_the_search_found():
    """A search that only found half of a part is the worse of the two by its surface, whatever its cells say."""
    truth = PARTS["L bracket"]
    points = cloud(truth, n=3000)
    unit, frame = in_unit_frame(target_from(points))
    rng = np.random.default_rng(0)
    seen, truth = observe(UnitBody.of(unit, rng), 2.5e-4, rng), frame.apply(truth)
    assert methods.prefers_proposal(truth, truth.left, seen)
    assert not methods.prefers_proposal(truth.left, truth, seen)
    assert not methods.prefers_proposal(truth, truth, seen)


def test_the_two_sides_of_a_thin_plate_are_no_noise_that_forgives_another_thickness():
    thin, thick = box(40, 30, 0.5), box(40, 30, 0.8)
    seen = seen_of(cloud(thin, n=4000))
    assert methods.prefers_proposal(thin, thick, seen)
    assert not methods.prefers_proposal(thick, thin, seen)


def test_no_checkpoint_and_a_foreign_one_are_one_line(tmp_path, checkpoint, monkeypatch):
    monkeypatch.setattr("imdim.reconstruction.policy_beam.SHIPPED", tmp_path / "none.safetensors")
    with pytest.raises(ConfigError, match=r"checkpoint: no checkpoint at .*none.safetensors"):
        load("")
    assert load_if_any("") is None
    assert load_if_any("none") is None
    (tmp_path / "text.safetensors").write_text("weights")
    with pytest.raises(ConfigError, match="not a safetensors file"):
        load_if_any(str(tmp_path / "text.safetensors"))
    mesh_of(box(1, 1, 1)).export(tmp_path / "a.stl")
    command = [sys.executable, str(ROOT / "infer.py"), f"input={tmp_path / 'a.stl'}", f"output={tmp_path / 'out'}", "method=policy"]
    done = subprocess.run([*command, f"checkpoint={tmp_path / 'gone'}"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.strip().splitlines()[-1].startswith("imdim: setting checkpoint: no checkpoint at")
    assert not (tmp_path / "out").exists()


def test_a_random_pose_changes_nothing():
    part = PARTS["L bracket"]
    turn = Rotation.random(random_state=1)
    points = turn.apply(cloud(part))
    found = proposals(None, points, 0.0)[0].program
    mesh = mesh_of(part)
    mesh.apply_transform(np.block([[turn.as_matrix(), np.zeros((3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]]))
    assert volume_iou(to_manifold(found), mesh_to_manifold(mesh)) >= 0.95
