"""What a policy proposes and the solver makes of it: `learn` and `solve` meet here, and the pipeline gets programs.

A cloud is turned into its main directions and scaled to the frame that policies know; a beam of sequences is written there, brought back,
and handed with the cloud to the solver of imperfect sequences. torch is only imported once a policy is asked for.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from imdim.config import ConfigError, first_line
from imdim.geometry.axes import main_axes
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.geometry.triangles import distances, triangle_tree
from imdim.program.cost import count
from imdim.program.sequence import SignedSequence, of_primitives, to_sequence
from imdim.program.tree import Primitive, Program
from imdim.seeding.cloud_denoise import inliers
from imdim.solve.pool import Cloud, PoolConfig
from imdim.solve.proposals import Proposal, ProposalConfig, settle

if TYPE_CHECKING:
    from torch import Tensor

    from imdim.data.solids import Solids
    from imdim.learn.decode import DecodeConfig
    from imdim.learn.policy import Policy

_HOMES = (Path(__file__).parents[2], Path(sys.prefix, "share/imdim"))  # a source tree, and where an installed wheel puts its data
_MODELS = [home / "models" / "imdim-base.safetensors" for home in _HOMES]
SHIPPED = next((model for model in _MODELS if model.is_file()), _MODELS[0])
POINTS = 2048  # of a cloud that a policy sees
NONE = "none"
MEASURED = 4096  # points each way of a misfit
FINE = ProposalConfig(seen=1536, most=8192)  # dense clouds show walls thinner than a policy's cloud can


def load(checkpoint: str) -> Policy:
    """The policy at a path, the shipped one for an empty one; ConfigError with one line where there is none that this version reads."""
    from imdim.learn.checkpoint import load_policy

    try:
        return load_policy(Path(checkpoint) if checkpoint else SHIPPED)[0]
    except (OSError, ValueError) as error:
        raise ConfigError(f"setting checkpoint: {first_line(error)}") from error


def load_if_any(checkpoint: str) -> Policy | None:
    """As `load`, but None for ``none``, and where no path is given and none is shipped."""
    return load(checkpoint) if checkpoint != NONE and (checkpoint or SHIPPED.is_file()) else None


@dataclass(frozen=True)
class Poses:
    """How clouds stand in the frame that policies know: ``local = (points @ axes - middle) * scale``, box centre 0, box diagonal 1.
    `axes` [b, 3, 3] have the main directions as columns, `middle` [b, 3], `scale` [b]."""

    axes: np.ndarray
    middle: np.ndarray
    scale: np.ndarray

    @staticmethod
    def of(clouds: Sequence[np.ndarray], axes: Sequence[np.ndarray]) -> Poses:
        """Of each cloud [n, 3] with its main directions [3, 3]."""
        turned = [c @ a for c, a in zip(clouds, axes, strict=True)]
        low, high = (np.stack([f(t, axis=0) for t in turned]) for f in (np.min, np.max))
        diagonals = np.maximum(np.linalg.norm(high - low, axis=1), 1e-300)
        return Poses(np.stack(axes), (low + high) / 2, 1 / diagonals)

    def local(self, clouds: np.ndarray) -> Tensor:
        """Clouds [b, n, 3] as policies see them."""
        import torch

        return torch.as_tensor((clouds @ self.axes - self.middle[:, None]) * self.scale[:, None, None], dtype=torch.float32)

    def back(self, solids: Solids) -> Solids:
        """Solids of the policy's frame, `k` rows for each cloud, in that of the clouds, in double precision."""
        import torch

        each = len(solids.kinds) // len(self.scale)
        turn, middle, scale = (torch.as_tensor(v).repeat_interleave(each, 0) for v in (self.axes, self.middle, self.scale))
        centers = solids.centers.double() / scale[:, None, None] + middle[:, None]
        return replace(
            solids,
            centers=centers @ turn.mT,
            sizes=solids.sizes.double() / scale[:, None, None],
            rotations=turn[:, None] @ solids.rotations.double(),
        )


def written(
    policy: Policy, points: np.ndarray, axes: np.ndarray, seed: int = 0, config: DecodeConfig | None = None
) -> list[SignedSequence[Primitive]]:
    """The sequences of a beam for the surface `points` [n, 3], best first, in their units; `axes` [3, 3] are the part's directions."""
    import torch

    from imdim.data.solids import to_signed
    from imdim.learn.beam import beam_search
    from imdim.learn.decode import DecodeConfig

    cloud = points[np.resize(np.random.default_rng(seed).permutation(len(points)), POINTS)]
    poses = Poses.of([cloud], [axes])
    render, chance = (torch.Generator().manual_seed(2 * seed + stream) for stream in (0, 1))
    found, _ = beam_search(policy, poses.local(cloud[None]), config or DecodeConfig(), render, chance)
    return [sequence for sequence in to_signed(poses.back(found)) if sequence]


def proposals(
    policy: Policy | None,
    points: np.ndarray,
    starts: Sequence[Program] = (),
    seed: int = 0,
    config: ProposalConfig | None = None,
    out_of_time: Callable[[], bool] = bool,
) -> list[Proposal]:
    """What the solver makes of a policy's beam and of other programs, for the surface `points` [n, 3]; cheapest first, never empty.

    Programs that are no signed sequence (intersections) are left out. Once `out_of_time` (by default never) the beam, which is written in
    any case, stays as it is.
    """
    # a stray point moves the box that a policy measures by
    points = points[inliers(points)]
    axes = main_axes(points[:: max(1, len(points) // POINTS)])
    given = [s for p in starts if (s := of_primitives(to_sequence(p))) is not None]
    beam = written(policy, points, axes, seed) if policy is not None else []
    return settle([*given, *beam], points, axes, config or FINE, out_of_time)


def misfit(program: Program, cloud: Cloud, config: PoolConfig | None = None) -> float:
    """The cost of `pool` for any program, by its exact surface: what it leaves of the cloud, what it has without the cloud, its price."""
    config = config or PoolConfig()
    surface = to_trimesh(to_manifold(program))
    if not len(surface.faces):
        return 1.0 + config.price * count(program).primitives
    explained, calm = config.explained * cloud.diagonal, config.calm * cloud.noise
    away = np.minimum(distances(triangle_tree(surface), cloud.thinned(MEASURED)), explained)
    shown = trimesh.sample.sample_surface(surface, MEASURED, seed=0)[0]
    bare = np.clip((cloud.tree.query(shown)[0] - calm) / cloud.spacing - 1.0, 0.0, 1.0)
    area = float(surface.area) / (len(cloud.points) * cloud.spacing**2)
    left = float(np.maximum(away - calm, 0.0).mean()) / explained
    return left + config.surface_weight * area * float(bare.mean()) + config.price * count(program).primitives
