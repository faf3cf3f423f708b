"""The table of a model card: a policy measured on synthetic targets of a fixed seed.

    python scripts/bench/evaluate.py checkpoint=models/imdim-base.safetensors

Prints the table and, with ``out=file.json``, writes every number. Clouds have no normals; IoU is by exact booleans; the best of a beam is
chosen by its distance to the cloud, without the truth. All settings are `EvaluateConfig`'s.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor

from imdim.app.arguments import from_arguments
from imdim.data.canonical import canonical
from imdim.data.solids import BOX, Solids, concatenate, empty, from_sequences, from_signed, to_signed
from imdim.data.synthesize import SynthesisConfig, TrainingSamples, synthesize
from imdim.geometry.axes import main_axes
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.learn.beam import beam_search
from imdim.learn.checkpoint import load_policy, replace_whole
from imdim.learn.decode import DecodeConfig, decode
from imdim.learn.measure import errors_by_kind, exact_structure, moves, summary
from imdim.learn.policy import Policy
from imdim.program.sequence import SignedSequence, to_program
from imdim.program.tree import Primitive, Program
from imdim.reconstruction.config import ConfigError
from imdim.reconstruction.poses import Poses
from imdim.search.mdl.repair import settle

HEAD = "| answer | median IoU | mean IoU | IoU >= 0.9 | exact structure | seconds per target |\n| --- | --- | --- | --- | --- | --- |"
T = TypeVar("T")
Answers = Sequence[SignedSequence[Primitive]]
LONG = (7, 12)  # primitives of the second range


@dataclass
class EvaluateConfig:
    """`n` targets of `synthesis` and `n_long` of 7 to 12 primitives from `seed`, which training streams never use; of each the `first` so
    many are answered whole (0: all), for a quick look at the same targets. Without `solver` its rows are left out. The model card has n=500
    n_long=200."""

    checkpoint: str = "models/imdim-base.safetensors"
    n: int = 60
    n_long: int = 0
    first: int = 0
    seed: int = 1000
    solver: bool = True
    threads: int = 1
    out: str = ""
    synthesis: SynthesisConfig = field(default_factory=lambda: SynthesisConfig(n_max=6))
    decode: DecodeConfig = field(default_factory=DecodeConfig)


def main(arguments: list[str], say: Callable[[str], object]) -> int:
    """Measure as `arguments` say, tell `say` the tables line by line; exit status 2 for bad settings or checkpoints."""
    try:
        config = from_arguments(EvaluateConfig, arguments)
        torch.set_num_threads(config.threads)
        policy, header = load_policy(Path(config.checkpoint))
    except (ConfigError, ValueError, OSError) as error:
        sys.stderr.write(f"evaluate: {error}\n")
        return 2
    results = {"header": header, "config": asdict(config), **measured(policy, config, say)}
    if config.out:
        replace_whole(Path(config.out), json.dumps(results, indent=1).encode())
    return 0


def measured(policy: Policy, config: EvaluateConfig, say: Callable[[str], object]) -> dict[str, object]:
    """All numbers for each range of lengths, as their tables are told to `say`."""
    results: dict[str, object] = {}
    for low, high, n in ((config.synthesis.n_min, config.synthesis.n_max, config.n), (*LONG, config.n_long)):
        if n:
            say(f"\n## {low} to {high} primitives, {config.first or n} of {n} targets\n")
            synthesis = replace(config.synthesis, n_min=low, n_max=high)
            batch = synthesize(n, synthesis, torch.Generator().manual_seed(config.seed))
            some = TrainingSamples(*(v[: config.first or n] for v in batch))
            results[f"{low}-{high}"] = {**step_results(policy, batch, say), "answers": answer_results(policy, some, config, say)}
    return results


def step_results(policy: Policy, batch: TrainingSamples, say: Callable[[str], object]) -> dict[str, object]:
    """How often the next token is right at true prefixes, and how far its numbers are off."""
    move, right = moves(policy, batch)
    errors = errors_by_kind(batch, move)
    say(f"token accuracy at random true prefixes: {float(right.float().mean()):.3f} ({len(right)} steps)\n")
    say("| next primitive of the right kind | n | centre | size | angle |\n| --- | --- | --- | --- | --- |")
    for name, e in errors.items():
        say(f"| {name} | {e.count} | {e.center:.4f} | {e.size:.4f} | {e.angle_deg:.1f} deg |")
    return {"token_accuracy": float(right.float().mean()), "errors": {name: asdict(e) for name, e in errors.items()}}


def answer_results(policy: Policy, batch: TrainingSamples, config: EvaluateConfig, say: Callable[[str], object]) -> dict[str, object]:
    """Exact IoU of whole answers. Each target is turned into its main directions first, which are estimated from the cloud."""
    truth = from_sequences(batch.gt_tokens, batch.gt_params)
    programs = written_programs(truth)
    say("\n" + HEAD)
    results: dict[str, object] = {}
    for name, (found, seconds) in _answers(policy, batch.gt_points, config):
        ious = [exact_iou(to_program(f) if f else None, t) for f, t in zip(found, programs, strict=True) if t is not None]
        exact = float(exact_structure(canonical(as_rows(found)), canonical(truth)).float().mean())
        s = summary(ious)
        say(f"| {name} | {s['median']:.3f} | {s['mean']:.3f} | {s['share_090']:.0%} | {exact:.0%} | {seconds:.2f} |")
        results[name] = {**s, "exact_structure": exact, "seconds": seconds, "ious": ious}
    return results


def written_programs(solids: Solids) -> list[Program | None]:
    """Each row as a program of the tree; None where nothing positive is there."""
    return [to_program(sequence) if sequence else None for sequence in to_signed(solids)]


def as_rows(sequences: Sequence[SignedSequence[Primitive]]) -> Solids:
    """The sequences as a batch; nothing for one with an outline that a solver has made more than a simple one."""
    rows = []
    for sequence in sequences:
        try:
            rows.append(from_signed([sequence]) if sequence else empty(1, 1))
        except ValueError:
            rows.append(empty(1, 1))
    return concatenate(rows, max(row.kinds.shape[1] for row in rows))


def exact_iou(found: Program | None, truth: Program) -> float:
    """Volume IoU by exact booleans, 0 where nothing was found."""
    return 0.0 if found is None else volume_iou(to_manifold(found), to_manifold(truth))


def bounding_boxes(gt_points: Tensor) -> Solids:
    """The answer that needs no policy: the cloud's box."""
    low, high = gt_points.amin(1), gt_points.amax(1)
    rows, device = len(low), low.device
    identity = torch.eye(3, device=device).expand(rows, 1, 3, 3)
    kinds = torch.full((rows, 1), BOX, device=device)
    return Solids.plain(kinds, torch.ones_like(kinds, dtype=torch.bool), ((low + high) / 2)[:, None], (high - low)[:, None], identity)


def _answers(policy: Policy, gt_points: Tensor, config: EvaluateConfig) -> Iterator[tuple[str, tuple[Answers, float]]]:
    """(name, (programs in the clouds' own frame, seconds per target)) of each way to answer; nothing in it looks at the truth."""
    clouds = gt_points.double().numpy()
    poses, turning = _timed(lambda: Poses.of(list(clouds), [main_axes(c) for c in clouds]), len(clouds))
    local = poses.local(clouds)
    render, chance = torch.Generator().manual_seed(config.seed), torch.Generator().manual_seed(config.seed + 1)
    yield "bounding box", _timed(lambda: to_signed(bounding_boxes(gt_points)), len(clouds))
    if config.solver:
        yield (
            "bounding box + solver",
            _timed(lambda: _solved([[s] for s in to_signed(bounding_boxes(gt_points))], clouds, poses), len(clouds)),
        )
    greedy, seconds = _timed(lambda: poses.back(decode(policy, local, config.decode, render)), len(clouds))
    yield "greedy", (to_signed(greedy), seconds + turning)
    width = config.decode.beam
    beams, seconds = _timed(lambda: poses.back(_beams(policy, local, config.decode, render, chance)), len(clouds))
    yield f"beam {width}", (to_signed(beams[torch.arange(len(clouds)) * width]), seconds + turning)
    if not config.solver:
        return
    candidates = [to_signed(beams[slice(i * width, (i + 1) * width)]) for i in range(len(clouds))]
    solved, more = _timed(lambda: _solved(candidates, clouds, poses), len(clouds))
    yield f"beam {width} + solver", (solved, seconds + turning + more)


def _timed(work: Callable[[], T], n: int) -> tuple[T, float]:
    """What `work` gives, and the seconds that it took for each of `n`."""
    start = time.monotonic()
    return work(), (time.monotonic() - start) / n


def _beams(policy: Policy, local: Tensor, config: DecodeConfig, render: torch.Generator, chance: torch.Generator, rows: int = 8) -> Solids:
    """All sequences of the beams of all clouds, `rows` clouds searched at a time."""
    parts = [beam_search(policy, local[i : i + rows], config, render, chance)[0] for i in range(0, len(local), rows)]
    return concatenate(parts, max(p.kinds.shape[1] for p in parts))


def _solved(candidates: Sequence[Sequence[SignedSequence[Primitive]]], clouds: np.ndarray, poses: Poses) -> Answers:
    return [settle(c, cloud, 0.0, axes)[0].signed for c, cloud, axes in zip(candidates, clouds, poses.axes, strict=True)]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], lambda text: print(text, flush=True)))
