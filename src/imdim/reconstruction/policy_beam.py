"""What a policy proposes and the solver makes of it: `learn` and `search.mdl` meet here, and the pipeline gets programs.

A cloud is turned into its main directions and scaled to the frame that policies know; a beam of sequences is written there, brought back,
and handed with the cloud to the solver of imperfect sequences. torch is only imported once a policy is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from imdim.deadline import NEVER, Deadline
from imdim.detection.cloud_denoise import inliers
from imdim.geometry import kernels
from imdim.geometry.axes import main_axes
from imdim.geometry.sampling import subsample
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.geometry.triangles import distances, triangle_tree
from imdim.program.cost import count
from imdim.program.sequence import SignedSequence, Step, of_primitives, to_program, to_sequence
from imdim.program.tree import Combine, Primitive, Program
from imdim.reconstruction.config import LEARNING, NONE, SHIPPED, ConfigError, first_line, lacking, require_extra
from imdim.reconstruction.poses import POINTS, Poses
from imdim.search.mdl.primitive_selection import Cloud, PoolConfig
from imdim.search.mdl.repair import Proposal, ProposalConfig, settle

if TYPE_CHECKING:
    from imdim.data.solids import Solids
    from imdim.learn.decode import DecodeConfig
    from imdim.learn.policy import Policy

PolicyOf = Callable[[], "Policy | None"]  # loads a policy when it is first asked for
ASKED, SHOWN = 64, 256  # draws of a policy, and points of a program's surface that it sees
HELD = 2  # parts of a program that are offered in common with what a policy would intersect it with
PROPOSE_S = 6.0  # what loading torch and writing a beam take of the processor; the solver works without it where less is left
MEASURED = 4096  # points each way of a misfit
FINE = ProposalConfig(seen=1536, most=8192)  # dense clouds show walls thinner than a policy's cloud can


def load(checkpoint: str) -> Policy:
    """The policy at a path, the shipped one for an empty one; ConfigError with one line where there is none that this version reads, or
    no torch."""
    require_extra("learn", "a policy", *LEARNING)
    from imdim.learn.checkpoint import load_policy

    try:
        return load_policy(Path(checkpoint) if checkpoint else SHIPPED)[0]
    except (OSError, ValueError) as error:
        raise ConfigError(f"setting checkpoint: {first_line(error)}") from error


def load_if_any(checkpoint: str) -> Policy | None:
    """As `load`, but None for ``none``, and where no path is given and none is shipped, or torch is not there."""
    return load(checkpoint) if checkpoint != NONE and (checkpoint or (SHIPPED.is_file() and not lacking(*LEARNING))) else None


def decode_sequences(
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


def has_time_for_beam(deadline: Deadline) -> bool:
    """Whether there is time to load torch and write a beam."""
    return deadline.left() >= PROPOSE_S


def beam_programs(policy: Policy, points: np.ndarray, seed: int = 0) -> list[Program]:
    """What a policy's beam writes for the surface `points` [n, 3], best first, as it is."""
    # a stray point moves the box that a policy measures by
    points = points[inliers(points)]
    return [to_program(s) for s in decode_sequences(policy, points, main_axes(subsample(points, POINTS)), seed)]


def next_parts(policy: Policy, points: np.ndarray, program: Program, seed: int = 0) -> list[Program]:
    """Parts that a policy would add to `program`, cut from it or put in the place of one of its own, for the surface `points` [n, 3]: ASKED
    draws without their signs. Of what it would intersect the program with, each is offered together with one of the program's first parts.

    A program of more steps than sequences hold, or of other outlines than simple ones, is seen by its solid alone.
    """
    import torch

    from imdim.data.canonical import canonical_primitives
    from imdim.data.solids import empty, to_signed
    from imdim.learn.policy import Sight

    points = points[inliers(points)]
    axes = main_axes(subsample(points, POINTS))
    cloud = points[np.resize(np.random.default_rng(seed).permutation(len(points)), POINTS)]
    poses = Poses.of([cloud], [axes])
    surface = to_trimesh(to_manifold(program))
    if not len(surface.faces):
        return []
    shown = poses.local(trimesh.sample.sample_surface(surface, SHOWN, seed=seed)[0][None])
    sequence = of_primitives(_spell(program))
    rows = _rows_of(sequence) if sequence is not None and len(sequence) < policy.max_seq_len - 1 else None
    if rows is not None:
        written, outside = canonical_primitives(poses.place(rows)), None
    else:
        written = empty(1, 1)
        level = kernels.program_sdf(program, cloud) * poses.scale[0]
        outside = torch.as_tensor(np.clip(level, -1.0, 1.0), dtype=torch.float32)[None]
    seen = Sight(poses.local(cloud[None]), shown, written, torch.ones(1, dtype=torch.bool), outside, must_add=True)
    move = policy.propose(seen, torch.Generator().manual_seed(2 * seed + 1), ASKED)
    common = move.part.common[:, 0].tolist()
    added = replace(move.part, positive=torch.ones_like(move.part.positive), common=torch.zeros_like(move.part.common))
    parts = to_signed(poses.back(added))
    own = [step.term for step in to_sequence(program) if step.positive and isinstance(step.term, Primitive)][:HELD]
    drawn = [(step.term, is_common) for steps, is_common in zip(parts, common, strict=True) for step in steps]
    return [p for part, is_common in drawn for p in (_held_by(part, own) if is_common else [part])]


def _spell(program: Program) -> SignedSequence[Program]:
    """As `to_sequence`, with the intersections on the way as steps."""
    first, *rest = to_sequence(program, apart=True)
    if not isinstance(first.term, Combine) or first.term.op != "intersection":
        return (first, *rest)
    return (*_spell(first.term.left), Step("intersection", first.term.right), *rest)


def _rows_of(sequence: SignedSequence[Primitive]) -> Solids | None:
    """The sequence as a row of a batch; None where it has an outline that is none of the simple ones."""
    from imdim.data.solids import from_signed

    try:
        return from_signed([sequence])
    except ValueError:
        return None


def _held_by(part: Primitive, own: Sequence[Primitive]) -> list[Program]:
    """What each of a program's `own` parts has in common with one that the program is to be intersected with."""
    return [Combine("intersection", other, part) for other in own]


def proposals(
    policy: Policy | None,
    points: np.ndarray,
    sigma: float,
    starts: Sequence[Program] = (),
    seed: int = 0,
    config: ProposalConfig | None = None,
    deadline: Deadline = NEVER,
) -> list[Proposal]:
    """What the solver makes of a policy's beam and of other programs, cheapest first, never empty; for the surface `points` [n, 3], whose
    noise has the deviation `sigma`.

    Programs that are no signed sequence (intersections) are left out. Past the `deadline` (by default never) the beam, which is written in
    any case, stays as it is.
    """
    # a stray point moves the box that a policy measures by
    points = points[inliers(points)]
    axes = main_axes(subsample(points, POINTS))
    given = [s for p in starts if (s := of_primitives(to_sequence(p))) is not None]
    beam = decode_sequences(policy, points, axes, seed) if policy is not None else []
    return settle([*given, *beam], points, sigma, axes, config or FINE, deadline)


def misfit(program: Program, cloud: Cloud, config: PoolConfig | None = None) -> float:
    """The cost of `primitive_selection` for any program, by its exact surface: what it leaves of the cloud, what it has without the cloud,
    and its price."""
    config = config or PoolConfig()
    surface = to_trimesh(to_manifold(program))
    if not len(surface.faces):
        return 1.0 + config.price * count(program).primitives
    explained, calm = config.explained * cloud.diagonal, config.calm * cloud.noise
    away = np.minimum(distances(triangle_tree(surface), subsample(cloud.points, MEASURED)), explained)
    shown = trimesh.sample.sample_surface(surface, MEASURED, seed=0)[0]
    bare = np.clip((cloud.tree.query(shown)[0] - calm) / cloud.spacing - 1.0, 0.0, 1.0)
    area = float(surface.area) / (len(cloud.points) * cloud.spacing**2)
    left = float(np.maximum(away - calm, 0.0).mean()) / explained
    return left + config.surface_weight * area * float(bare.mean()) + config.price * count(program).primitives
