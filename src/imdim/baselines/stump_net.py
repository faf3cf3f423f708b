"""CSG-Stump Net wired to a body: the network's shape for its cloud, fitted to its labelled samples, as a program.

The cloud is turned into its main directions and scaled to the frame that networks know, as for policies (`poses`).
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from imdim.deadline import Deadline
from imdim.detection.cloud_denoise import inliers
from imdim.geometry import kernels
from imdim.geometry.axes import main_axes
from imdim.geometry.rotations import euler_from_matrix, matrix_from_euler
from imdim.program.cost import count
from imdim.program.rewrite.simplify import simplify
from imdim.program.stump import to_program
from imdim.program.tree import Primitive, Program, map_leaves
from imdim.reconstruction.config import NONE, SHIPPED, ConfigError, first_line
from imdim.reconstruction.observation import Observation
from imdim.reconstruction.poses import POINTS, Poses

if TYPE_CHECKING:
    from imdim.learn.stump.net import StumpNet

MODEL = "imdim-stump.safetensors"
RANDOM = (64, 32)  # primitives and intersections of a random start
CHECKS, JUDGED = 60, 32_768  # programs that simplification may compare, and by how many samples


@lru_cache(maxsize=1)
def load(checkpoint: str) -> StumpNet | None:
    """The network at a path, the shipped one for an empty one, None for ``none`` and where none is shipped; ConfigError with one line."""
    from imdim.learn.checkpoint import load_stump

    path = Path(checkpoint) if checkpoint else SHIPPED.with_name(MODEL)
    if checkpoint == NONE or (not checkpoint and not path.is_file()):
        return None
    try:
        return load_stump(path)[0]
    except (OSError, ValueError) as error:
        raise ConfigError(f"setting stump_checkpoint: {first_line(error)}") from error


def propose_program(seen: Observation, net: StumpNet | None, seed: int, deadline: Deadline) -> Program:
    """The program of what the network sees, or of a random start without one, after the fit."""
    import torch

    from imdim.learn.stump.binary import LabelledPoints
    from imdim.learn.stump.fit import FitConfig, fit, random_start

    torch.set_num_threads(1)
    points = seen.target.points[inliers(seen.target.points)]
    order = np.random.default_rng(seed).permutation(len(points))
    cloud = points[np.resize(order, POINTS)]
    # where there are fewer points than that, repeated ones would show no plane
    poses, samples = Poses.of([cloud], [main_axes(points[order[:POINTS]])]), seen.samples
    labels = LabelledPoints(poses.local(samples.points[None])[0].double().numpy(), samples.w_in, samples.w_out)
    if net is None:
        start = random_start(labels, *RANDOM, seed)
    else:
        with torch.no_grad():
            start = net(poses.local(cloud[None])[:, : net.config.cloud])
    stump = fit(start, labels, FitConfig(price=seen.size_weight), seed, deadline)
    referee = labels.some(np.random.default_rng(seed + 1).permutation(len(labels.points))[:JUDGED])

    def price(program: Program) -> float:
        wrong = np.where(kernels.inside(program, referee.points), referee.w_out, referee.w_in).sum() / referee.w_in.sum()
        return float(wrong) + seen.size_weight * count(program).primitives

    program = simplify(to_program(stump), lambda given, candidate: price(candidate) <= price(given), max_checks=CHECKS)
    return _back(program, poses)


def _back(program: Program, poses: Poses) -> Program:
    """A program of the network's frame in the frame of the cloud."""
    axes, middle, scale = poses.axes[0], poses.middle[0], float(poses.scale[0])

    def leaf(_: int, p: Primitive) -> Primitive:
        x, y, z = (axes @ (np.asarray(p.center) / scale + middle)).tolist()
        return replace(
            p, size=tuple(s / scale for s in p.size), center=(x, y, z), rotation=euler_from_matrix(axes @ matrix_from_euler(p.rotation))
        )

    return map_leaves(program, leaf)
