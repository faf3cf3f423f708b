"""Relations between directions: axes along the frame's or along each other, and right angles.

Leaf after leaf, the best known first, each axis is offered the directions that stand already. An axis that takes none opens a new one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from imdim.program.constraints import AXES, AXES_OF, WORLD, Constraint, Ref
from imdim.relations.select import RelationCandidate, RelationSelection

NEAR = math.sin(math.radians(20))  # what is further off is no candidate
KIND_BITS = 2.0


@dataclass
class Directions:
    """Directions that stand, and the axes along each: `members[i]` begins with the one that stands for it."""

    members: list[list[Ref]] = field(default_factory=lambda: [[Ref(WORLD, a)] for a in AXES])

    @property
    def used(self) -> list[list[Ref]]:
        """Those of two or more axes, or of leaves; all of the frame's as soon as one of them is used, or if there is no other."""
        world, others = self.members[:3], self.members[3:]
        return (world if not others or any(len(m) > 1 for m in world) else []) + others


def relate_directions(choice: RelationSelection) -> tuple[Directions, list[Constraint]]:
    """Accept what holds among the directions of all leaves."""
    found, accepted = Directions(), []
    turns = np.diagonal(choice.covariance).reshape(-1, 9)[:, 6:]
    for leaf in np.argsort(turns.sum(1), kind="stable").tolist():
        axes = [Ref(leaf, axis) for axis in AXES_OF[choice.pose.kind(leaf)]]
        # an axis is known as well as the turns about the other two are
        axes.sort(key=lambda ref: turns[leaf].sum() - turns[leaf, ref.axis])
        for ref in axes:
            accepted += _settle(ref, found, choice)
    return found, accepted


def _settle(ref: Ref, found: Directions, choice: RelationSelection) -> list[Constraint]:
    """Join the direction that saves most; else stand alone, at right angles to others where that saves something."""
    bits = KIND_BITS + math.log2(len(found.members))
    axis, stand = _vector(ref, choice), [_vector(m[0], choice) for m in found.members]
    close = [m for m, v in zip(found.members, stand, strict=True) if np.linalg.norm(np.cross(v, axis)) < NEAR]
    offers = [(m, RelationCandidate(Constraint("parallel", (m[0], ref)), bits)) for m in close if m[0].leaf != ref.leaf]
    judged = [(choice.judge(offer), members, offer) for members, offer in offers]
    best = max(judged, key=lambda j: (j[0].rank == 0, j[0].saving), default=None)
    if best is not None and (best[0].rank == 0 or best[0].saving > 0):
        best[1].append(ref)
        return choice.greedy([best[2]]) if best[0].rank else []
    upright = [m for m, v in zip(found.members, stand, strict=True) if abs(v @ axis) < NEAR and m[0].leaf != ref.leaf]
    offers = [RelationCandidate(Constraint("perpendicular", (m[0], ref)), bits) for m in upright if m[0].leaf != WORLD or len(m) > 1]
    accepted = choice.greedy(offers)
    found.members.append([ref])
    return accepted


def _vector(ref: Ref, choice: RelationSelection) -> np.ndarray:
    return np.eye(3)[ref.axis] if ref.leaf == WORLD else choice.numbers.rotations[ref.leaf][:, ref.axis]
