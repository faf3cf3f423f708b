"""A training run on the terminal and in tensorboard, with small pictures: targets on the left, what was written for them on the right."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch

from imdim.app.arguments import from_arguments
from imdim.data.solids import Solids
from imdim.data.surfaces import surface_clouds
from imdim.export.preview import RESULT_COLOUR, TARGET_COLOUR, Camera, discs, view_axes
from imdim.learn.distributed import processes
from imdim.learn.optimise import NotFinite
from imdim.learn.settings import TrainConfig, fill_defaults
from imdim.learn.train import Report, train
from imdim.reconstruction.config import ConfigError, first_line

R = TypeVar("R")
PIXELS = 128
POINTS = 12_000


def main(arguments: Sequence[str], configs: Path, say: Callable[[str], object]) -> int:
    """Train as `arguments` say, report each epoch to `say` and to tensorboard in the run's folder; exit status 2 for bad settings."""
    rank = 0
    try:
        config = from_arguments(TrainConfig, arguments, configs, "pretrain")
        with processes(check_device(config.device)) as (group, device):
            rank = group.rank
            config = fill_defaults(replace(config, device=device), group.count)
            notes = {"command": "python pretrain.py " + " ".join(arguments), "commit": commit(), "hardware": hardware(config, group.count)}
            for report in log_to_tensorboard(config.out, train(config, notes, processes=group), log):
                say(line(report))
    except (ConfigError, ValueError, OSError, NotFinite) as error:
        if rank == 0:
            sys.stderr.write(f"pretrain: {error}\n")
        return 1 if isinstance(error, NotFinite) else 2
    return 0


def log_to_tensorboard(out: str, reports: Iterable[R], log: Callable[[Any, R], None]) -> Iterator[R]:
    """The same reports, each logged for tensorboard in the folder `out` as it passes; no folder is made before the first."""
    from torch.utils.tensorboard import SummaryWriter

    with ExitStack() as stack:
        writer = None
        for report in reports:
            writer = writer or stack.enter_context(SummaryWriter(out))
            log(writer, report)
            writer.flush()
            yield report


def check_device(name: str) -> str:
    """`name`, if torch can compute there. Raises ConfigError."""
    try:
        torch.zeros(1, device=name)
    except (RuntimeError, AssertionError) as error:
        raise ConfigError(f"setting device: cannot use {name!r}: {first_line(error)}") from error
    return name


def line(report: Report) -> str:
    """One line for people."""
    parts = " ".join(f"{name} {value:.3f}" for name, value in report.val.items())
    written = "".join(f" {name} {value:.3f}" for name, value in report.measured.items() if name.startswith(("iou", "exact")))
    pace = f"lr {report.lr:.1e}, {report.samples_per_second:.0f} samples/s, {report.data_share:.1%} waiting for data, "
    pace += f"{report.validation_share:.1%} validation"
    mark = " *" if report.best else ""
    stop = f", stopped: {report.stop}" if report.stop else ""
    return f"step {report.step}: train {report.train['loss']:.3f}, val {parts}{written}, {pace}{mark}{stop}"


def log(writer: Any, report: Report) -> None:
    """All numbers against samples seen, and pictures of targets beside what was written."""
    pace = {name: getattr(report, name) for name in ("lr", "samples_per_second", "data_share", "validation_share")}
    for group, values in (("train", report.train), ("val", report.val | report.measured), ("run", pace)):
        for name, value in values.items():
            writer.add_scalar(f"{group}/{name}", value, report.samples)
    if report.shown is not None:
        picture = pairs(report.shown.truth, report.shown.found)
        writer.add_image("target and written", picture, report.samples, dataformats="HWC")


def commit() -> str:
    """The commit of the source, or "unknown" outside of a checkout."""
    result = subprocess.run(
        ["git", "-C", str(Path(__file__).parent), "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    )
    return result.stdout.strip() if result.returncode == 0 else "unknown"


def hardware(config: TrainConfig, count: int) -> str:
    """What the run computes on."""
    cuda = config.device.startswith("cuda")
    one = torch.cuda.get_device_name(config.device) if cuda else f"{config.threads} CPU thread(s), {config.workers} worker(s)"
    return one if count == 1 else f"{count} processes of {one}"


def pairs(truth: Solids, found: Solids, most: int = 8) -> np.ndarray:
    """One picture uint8 [rows * PIXELS, 2 * PIXELS, 3] of the first `most` rows; solids have a diagonal of about 1 around 0."""
    panels = [_panels(solids[:most], colour) for solids, colour in ((truth, TARGET_COLOUR), (found, RESULT_COLOUR))]
    return np.concatenate([np.concatenate(row, 1) for row in zip(*panels, strict=True)], 0)


def _panels(solids: Solids, colour: np.ndarray) -> list[np.ndarray]:
    chance = torch.Generator(solids.kinds.device).manual_seed(0)
    points, normals, count = surface_clouds(solids, POINTS, chance)
    rows = zip(points.cpu().double().numpy(), normals.cpu().double().numpy(), count.tolist(), strict=True)
    return [draw_cloud(p[: c or 0], n[: c or 0], colour) for p, n, c in rows]


def draw_cloud(points: np.ndarray, normals: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """Oriented points [n, 3] as lit discs on white, nearest on top, uint8 [PIXELS, PIXELS, 3]."""
    camera = Camera(view_axes(), np.zeros(3), 0.9 * PIXELS, PIXELS)
    # what faces away would shine through between the discs
    front = normals @ camera.axes[2] > 0
    if not front.any():
        return np.full((PIXELS, PIXELS, 3), 255, np.uint8)
    return np.asarray(discs(points[front], normals[front], camera, colour))
