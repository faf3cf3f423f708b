"""What the decoder says: K primitives and the logits of the connection matrices; and the occupancy that follows.

A primitive is ten numbers: a quaternion [4], the centre [3] and sizes [3] read by magnitude, of which each kind uses its own. The paper
gives each kind its own numbers; one record with idle places packs them alike. Cylinders and cones have ends here, as everywhere in the
project, where the authors' code has endless ones.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from imdim.data.dice import Dice, quaternion_matrices
from imdim.data.solids import euler_from_matrices
from imdim.geometry.sdf import LOCAL_SDF
from imdim.learn.stump.layers import complement_nodes, intersect_nodes, unite_terms
from imdim.program.tree import SIZE_NAMES, Primitive

KINDS = ("box", "sphere", "cylinder", "cone")
NUMBERS = 10
LEAST = 1e-3  # a size, of the diagonal


@dataclass(frozen=True)
class Decoded:
    """`numbers` [b, K, 10] of primitives whose `kinds` (indices into KINDS) rise along K and are those of every row; logits of
    W_C `complement` [b, K], of W_I `connection` [b, C, K], of W_U `union` [b, C]."""

    kinds: tuple[int, ...]
    numbers: Tensor
    complement: Tensor
    connection: Tensor
    union: Tensor

    @property
    def tensors(self) -> list[Tensor]:
        """All but the kinds."""
        return [getattr(self, f.name) for f in fields(self)[1:]]


def even_kinds(count: int) -> tuple[int, ...]:
    """As many primitives of each kind."""
    return tuple(kind for kind in range(len(KINDS)) for _ in range(count // len(KINDS)))


def start(primitives: int, intersections: int, generator: torch.Generator) -> Decoded:
    """A shape to begin with: of each kind half plain and half complemented, small, anywhere, upright; each intersection takes one plain
    primitive, and cuts are nearly connected."""
    dice, kinds = Dice(generator, primitives), even_kinds(primitives)
    upright = torch.tensor([1.0, 0.0, 0.0, 0.0]) + 0.05 * dice.normal(4)
    sizes = dice.uniform(0.05, 0.3, 3) * torch.tensor([[1.0], [0.5], [0.5], [0.5]])[list(kinds)]
    numbers = torch.cat([upright, dice.uniform(-0.3, 0.3, 3), sizes], -1)
    cut = torch.arange(primitives) % 2 == 1
    plain = (~cut).nonzero()[:, 0]
    own = plain[torch.arange(intersections) % len(plain)]
    connection = torch.where(cut, -1.0, -3.0).repeat(intersections, 1)
    connection[torch.arange(intersections), own] = 2.0
    complement = torch.where(cut, 2.0, -2.0)
    return Decoded(kinds, numbers[None], complement[None], connection[None], torch.ones(1, intersections))


def distances(kinds: tuple[int, ...], numbers: Tensor, points: Tensor) -> Tensor:
    """Signed distances [b, n, K] of `points` [b, n, 3] to the primitives."""
    quaternions, centers, sizes = numbers.split([4, 3, 3], -1)
    local = (points[:, None] - centers[:, :, None]) @ quaternion_matrices(quaternions)
    sizes = (sizes.abs() + LEAST)[:, :, None]
    columns = []
    for kind, name in enumerate(KINDS):
        first, count = kinds.index(kind) if kind in kinds else 0, kinds.count(kind)
        if count:
            columns.append(LOCAL_SDF[name](local[:, first : first + count], sizes[:, first : first + count]))
    return torch.cat(columns, 1).mT.contiguous()


def occupancy(shape: Decoded, points: Tensor, eta: float, binary: bool = False) -> tuple[Tensor, Tensor]:
    """T [b, n] at `points` [b, n, 3], and the primitives' signed distances [b, n, K]. O is sigmoid(-eta SDF).

    The matrices are sigmoids; where `binary`, they are 0 and 1 with the gradients of sigmoids (straight through, Bengio et al. 2013).
    """
    sdf = distances(shape.kinds, shape.numbers, points)
    complement, connection, union = (_matrix(logits, binary) for logits in (shape.complement, shape.connection, shape.union))
    terms = intersect_nodes(complement_nodes(torch.sigmoid(-eta * sdf), complement), connection)
    return unite_terms(terms, union), sdf


def _matrix(logits: Tensor, binary: bool) -> Tensor:
    soft = logits.sigmoid()
    return (logits > 0).to(soft) + (soft - soft.detach()) if binary else soft


def to_primitives(shape: Decoded) -> list[Primitive]:
    """The K primitives of a batch of one, in double precision."""
    quaternions, centers, sizes = shape.numbers[0].detach().double().split([4, 3, 3], -1)
    euler = euler_from_matrices(quaternion_matrices(quaternions))
    rows = zip(shape.kinds, (sizes.abs() + LEAST).tolist(), centers.tolist(), euler.tolist(), strict=True)
    return [Primitive(KINDS[k], tuple(s[: len(SIZE_NAMES[KINDS[k]])]), tuple(c), tuple(e)) for k, s, c, e in rows]  # type: ignore[arg-type]
