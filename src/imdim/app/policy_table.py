"""The table of a model card: a policy measured on synthetic targets of a fixed seed."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

import torch

from imdim.app.arguments import from_arguments
from imdim.config import ConfigError
from imdim.data.solids import from_sequences
from imdim.data.synthesize import Samples, SynthesisConfig, synthesize
from imdim.learn.checkpoint import load_policy
from imdim.learn.decode import DecodeConfig
from imdim.learn.measure import answers, errors_by_kind, exact_iou, exact_structure, moves, summary, written_programs
from imdim.learn.policy import Policy


@dataclass
class EvaluateConfig:
    """`n` targets of `synthesis` from `seed`, which training streams never use."""

    checkpoint: str = "models/imdim-base.safetensors"
    n: int = 100
    seed: int = 1000
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
    batch = synthesize(config.n, config.synthesis, torch.Generator().manual_seed(config.seed))
    results = {
        "header": header,
        "config": asdict(config),
        **step_results(policy, batch, say),
        "answers": answer_results(policy, batch, config, say),
    }
    if config.out:
        Path(config.out).write_text(json.dumps(results, indent=1))
    return 0


def step_results(policy: Policy, batch: Samples, say: Callable[[str], object]) -> dict[str, object]:
    """How often the next token is right at true prefixes, and how far its numbers are off."""
    move, right = moves(policy, batch)
    errors = errors_by_kind(batch, move)
    say(f"token accuracy at random true prefixes: {float(right.float().mean()):.3f} ({len(right)} steps)\n")
    say("| next primitive of the right kind | n | centre | size | angle |\n| --- | --- | --- | --- | --- |")
    for name, e in errors.items():
        say(f"| {name} | {e.count} | {e.center:.4f} | {e.size:.4f} | {e.angle_deg:.1f} deg |")
    return {"token_accuracy": float(right.float().mean()), "errors": {name: asdict(e) for name, e in errors.items()}}


def answer_results(policy: Policy, batch: Samples, config: EvaluateConfig, say: Callable[[str], object]) -> dict[str, object]:
    """Exact IoU of whole answers."""
    truth = from_sequences(batch.gt_tokens, batch.gt_params)
    programs = written_programs(truth)
    say("\n| answer | median IoU | mean IoU | IoU >= 0.9 | exact structure | seconds per target |\n| --- | --- | --- | --- | --- | --- |")
    results: dict[str, object] = {}
    for name, answer in answers(policy, batch.gt_points, config.decode).items():
        start = time.monotonic()
        found = answer()
        seconds = (time.monotonic() - start) / config.n
        ious = [exact_iou(f, t) for f, t in zip(written_programs(found), programs, strict=True) if t is not None]
        exact = float(exact_structure(found, truth).float().mean())
        s = summary(ious)
        say(f"| {name} | {s['median']:.3f} | {s['mean']:.3f} | {s['share_090']:.0%} | {exact:.0%} | {seconds:.2f} |")
        results[name] = {**s, "exact_structure": exact, "seconds": seconds, "ious": ious}
    return results
