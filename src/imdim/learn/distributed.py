"""Several processes that train one policy, each on its own part of every batch: what torchrun starts, seen from one of them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import torch
import torch.distributed as dist
from torch import Tensor


@dataclass(frozen=True)
class Processes:
    """This process is number `rank` of `count`; the first one validates, reports and writes."""

    rank: int = 0
    count: int = 1

    @property
    def first(self) -> bool:
        return self.rank == 0

    def total(self, tensors: Sequence[Tensor]) -> None:
        """Make each tensor its sum over all processes, in place and in one exchange."""
        if self.count == 1:
            return
        together = torch.cat([t.flatten() for t in tensors])
        dist.all_reduce(together)
        for tensor, part in zip(tensors, together.split([t.numel() for t in tensors]), strict=True):
            tensor.copy_(part.view_as(tensor))

    def agree(self, values: Sequence[int], device: str) -> list[int]:
        """What the first process has."""
        if self.count == 1:
            return list(values)
        shared = torch.tensor(values, device=device)
        dist.broadcast(shared, 0)
        return shared.tolist()


@contextmanager
def processes(device: str) -> Iterator[tuple[Processes, str]]:
    """The processes that torchrun's environment names, or this one alone, and the device of this one."""
    count = int(os.environ.get("WORLD_SIZE", "1"))
    if count == 1:
        yield Processes(), device
        return
    cuda = device == "cuda"
    dist.init_process_group("nccl" if cuda else "gloo")
    try:
        yield Processes(dist.get_rank(), count), f"cuda:{os.environ['LOCAL_RANK']}" if cuda else device
    finally:
        dist.destroy_process_group()
