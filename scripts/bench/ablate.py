"""What each change of design is worth: policies with one of them taken back, trained for the same time, measured on the same targets.

    python scripts/bench/ablate.py minutes=5 [only=[pointing]]

Prints the table of the model card; checkpoints and every number are in runs/ablation. All settings are `AblationConfig`'s.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from evaluate import EvaluateConfig, measured

from imdim.app.arguments import from_arguments
from imdim.app.pretrain import commit
from imdim.learn.checkpoint import load_policy, replace_whole
from imdim.learn.optimise import NotFinite
from imdim.learn.settings import TrainConfig
from imdim.learn.train import train
from imdim.reconstruction.config import ConfigError

# one validation, at the end; clean clouds, as those that are answered
SETTING = ["epochs=1000", "samples_per_epoch=1000000", "workers=0", "warmup=100", "n_val=64", "n_measure=8"]
SETTING += ["synthesis.n_max=6", "synthesis.gt_points=1024", "synthesis.free_rotation=0.05", "synthesis.tilt=0.3"]
SETTING += [f"synthesis.augment.p_{effect}=0" for effect in ("noise", "outliers", "uneven", "missing", "views")]
VARIANTS: Mapping[str, tuple[str, ...]] = {
    "all changes": (),
    "regression for distributions": ("base.distributions=false",),
    "one max-pooled vector for local tokens": ("base.local=false",),
    "without seeing what is written": ("base.feedback=false",),
    "without pointing at marks": ("base.pointing=false",),
    "without canonical order": ("synthesis.canonical_order=false",),
    "without canonical numbers": ("synthesis.canonical_numbers=false", "base.canonical=false"),
    "without shaken prefixes and mistakes": ("synthesis.p_shaken=0", "synthesis.p_undo=0"),
    "without profiles within the ends chosen": ("base.within=false",),
    "Euler angles for a continuous rotation code": ("base.rotation=euler",),
    "the seed design": ("experiment=seed",),
}
CARD_TARGETS = 500
HEAD = (
    "| policy | steps | right next token | turned parts | greedy: median (mean) IoU | beam: median (mean) IoU | exact structure |\n"
    "| --- | --- | --- | --- | --- | --- | --- |"
)


@dataclass
class AblationConfig:
    """Each variant learns for `minutes` of this process's CPU time, which other work on the machine does not shorten, and answers the first
    `n` targets of the model card. `only`: the variants with one of these words in their names. `out` gets checkpoints and all numbers."""

    minutes: float = 5.0
    n: int = 100
    only: tuple[str, ...] = ()
    seed: int = 0
    precision: str = "bfloat16"
    threads: int = 1
    batch_size: int = 64
    lr: float = 1e-3
    out: str = "runs/ablation"


def main(arguments: Sequence[str], configs: Path, say: Callable[[str], object]) -> int:
    """Train and measure as `arguments` say and tell `say` the table row by row; exit status 2 for bad settings."""
    try:
        config = from_arguments(AblationConfig, arguments)
        say(f"{config.minutes:g} minutes of CPU time each, {config.n} targets of 1 to 6 primitives\n\n{HEAD}")
        rows: dict[str, dict[str, Any]] = {}
        for name in chosen(config.only):
            rows[name] = trained_and_measured(config, name, configs)
            say(row_of(name, rows[name]))
            document = {"commit": commit(), "config": asdict(config), "rows": rows}
            replace_whole(Path(config.out) / "ablation.json", json.dumps(document, indent=1).encode())
    except (ConfigError, ValueError, OSError, NotFinite) as error:
        sys.stderr.write(f"ablate: {error}\n")
        return 1 if isinstance(error, NotFinite) else 2
    return 0


def chosen(words: Sequence[str]) -> list[str]:
    """Names of variants. Raises ConfigError for a word that no name has."""
    for word in words:
        if not any(word in name for name in VARIANTS):
            raise ConfigError(f"setting only: no variant has {word!r} in its name; known are {'; '.join(VARIANTS)}")
    return [name for name in VARIANTS if not words or any(word in name for word in words)]


def trained_and_measured(config: AblationConfig, name: str, configs: Path) -> dict[str, Any]:
    """Steps taken and all numbers of the variant `name`."""
    own = [f"{key}={getattr(config, key)}" for key in ("seed", "precision", "threads", "batch_size", "lr")]
    folder = Path(config.out) / name.replace(" ", "_")
    arguments = [*SETTING, *own, f"max_minutes={config.minutes}", f"out={folder}", *VARIANTS[name]]
    last = list(train(from_arguments(TrainConfig, arguments, configs, "pretrain"), {"variant": name}, clock=time.process_time))[-1]
    policy, _ = load_policy(folder / "best.safetensors")
    evaluation = EvaluateConfig(n=CARD_TARGETS, first=config.n, solver=False)
    return {"settings": VARIANTS[name], "steps": last.step, "samples": last.samples, **measured(policy, evaluation, lambda _: None)}


def row_of(name: str, row: Mapping[str, Any]) -> str:
    """A line of the table."""
    results = row["1-6"]
    greedy, beam = (next(v for key, v in results["answers"].items() if key.startswith(word)) for word in ("greedy", "beam"))
    angle = results["errors"]["turned"]["angle_deg"]
    ious = " | ".join(f"{v['median']:.3f} ({v['mean']:.3f})" for v in (greedy, beam))
    return f"| {name} | {row['steps']} | {results['token_accuracy']:.3f} | {angle:.1f} deg | {ious} | {beam['exact_structure']:.0%} |"


if __name__ == "__main__":
    if {"-h", "--help"} & set(sys.argv):
        print(__doc__)
        sys.exit(0)
    sys.exit(main(sys.argv[1:], Path(__file__).parents[2] / "configs", lambda text: print(text, flush=True)))
