"""How clouds stand in the frame that networks know: turned into their main directions, box centre 0, box diagonal 1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor

    from imdim.data.solids import Solids

POINTS = 2048  # of a cloud that a network sees


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

    def place(self, solids: Solids) -> Solids:
        """Solids in the frame of the clouds, one row for each, as policies see them."""
        import torch

        turn, middle, scale = (torch.as_tensor(v) for v in (self.axes, self.middle, self.scale))
        return replace(
            solids,
            centers=((solids.centers.double() @ turn - middle[:, None]) * scale[:, None, None]).float(),
            sizes=(solids.sizes.double() * scale[:, None, None]).float(),
            rotations=(turn.mT[:, None] @ solids.rotations.double()).float(),
            shares=solids.shares.float(),
        )

    def back(self, solids: Solids) -> Solids:
        """Solids of the policy's frame, as many rows for each cloud, in that of the clouds, in double precision."""
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
