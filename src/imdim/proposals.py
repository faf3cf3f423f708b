"""What a policy proposes and the solver makes of it: `learn` and `solve` meet here, and the pipeline gets programs.

A cloud is turned into its main directions and scaled to the frame that policies know; a beam of sequences is written there, brought back,
and handed with the cloud to the solver of imperfect sequences. torch is only imported once a policy is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from imdim.config import ConfigError, first_line
from imdim.geometry.axes import main_axes
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.geometry.triangles import distances, triangle_tree
from imdim.program.cost import count
from imdim.program.tree import Program
from imdim.solve.pool import Cloud, PoolConfig, Signed, to_signed
from imdim.solve.proposals import Proposal, ProposalConfig, settle

if TYPE_CHECKING:
    from imdim.data.solids import Solids
    from imdim.learn.decode import DecodeConfig
    from imdim.learn.policy import Policy

SHIPPED = Path(__file__).parents[2] / "models" / "imdim-base.safetensors"
POINTS = 2048  # of a cloud that a policy sees


def load(checkpoint: str) -> Policy:
    """The policy at a path, the shipped one for an empty one; ConfigError with one line where there is none that this version reads."""
    from imdim.learn.checkpoint import load_policy

    try:
        return load_policy(Path(checkpoint) if checkpoint else SHIPPED)[0]
    except (OSError, ValueError) as error:
        raise ConfigError(f"setting checkpoint: {first_line(error)}") from error


def load_if_any(checkpoint: str) -> Policy | None:
    """As `load`, but None where no path is given and none is shipped."""
    return load(checkpoint) if checkpoint or SHIPPED.is_file() else None


def written(policy: Policy, points: np.ndarray, axes: np.ndarray, seed: int = 0, config: DecodeConfig | None = None) -> list[Signed]:
    """The sequences of a beam for the surface `points` [n, 3], best first, in their units; `axes` [3, 3] are the part's directions."""
    import torch

    from imdim.learn.beam import beam_search
    from imdim.learn.decode import DecodeConfig
    from imdim.learn.measure import written_programs

    config = config or DecodeConfig()
    chosen = np.random.default_rng(seed).permutation(len(points))[:POINTS]
    local = points[np.resize(chosen, POINTS)] @ axes
    low, high = local.min(0), local.max(0)
    middle, scale = (low + high) / 2, float(np.linalg.norm(high - low)) or 1.0
    cloud = torch.as_tensor((local - middle) / scale, dtype=torch.float32)[None]
    render, chance = (torch.Generator().manual_seed(2 * seed + stream) for stream in (0, 1))
    with torch.no_grad():
        found, _ = beam_search(policy, cloud, config, render, chance)
    programs = written_programs(_placed(found, axes, middle, scale))
    return [s for p in programs if p is not None and (s := to_signed(p)) is not None]


def _placed(solids: Solids, axes: np.ndarray, middle: np.ndarray, scale: float) -> Solids:
    """Solids of the policy's frame in that of the points, in double precision."""
    import torch

    turn, centre = torch.as_tensor(axes), torch.as_tensor(middle)
    return replace(
        solids,
        centers=(solids.centers.double() * scale + centre) @ turn.mT,
        sizes=solids.sizes.double() * scale,
        rotations=turn @ solids.rotations.double(),
    )


def proposals(
    policy: Policy | None, points: np.ndarray, starts: Sequence[Program] = (), seed: int = 0, config: ProposalConfig | None = None
) -> list[Proposal]:
    """What the solver makes of a policy's beam and of other programs, for the surface `points` [n, 3]; cheapest first, never empty.

    Programs that are no signed sequence (intersections) are left out.
    """
    axes = main_axes(points[:: max(1, len(points) // POINTS)])
    given = [s for p in starts if (s := to_signed(p)) is not None]
    return settle([*given, *(written(policy, points, axes, seed) if policy is not None else [])], points, axes, config)


def misfit(program: Program, cloud: Cloud, config: PoolConfig | None = None) -> float:
    """The cost of `pool` for any program, by its exact surface: what it leaves of the cloud, what it has without the cloud, its price."""
    config = config or PoolConfig()
    surface = to_trimesh(to_manifold(program))
    if not len(surface.faces):
        return 1.0 + config.price * count(program).primitives
    explained, calm = config.explained * cloud.diagonal, config.calm * cloud.noise
    away = np.minimum(distances(triangle_tree(surface), cloud.thinned(POINTS)), explained)
    shown = trimesh.sample.sample_surface(surface, POINTS, seed=0)[0]
    bare = np.clip((cloud.tree.query(shown)[0] - calm) / cloud.spacing - 1.0, 0.0, 1.0)
    area = float(surface.area) / (len(cloud.points) * cloud.spacing**2)
    left = float(np.maximum(away - calm, 0.0).mean()) / explained
    return left + config.surface_weight * area * float(bare.mean()) + config.price * count(program).primitives
