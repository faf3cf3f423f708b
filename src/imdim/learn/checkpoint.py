"""Weights in safetensors with what is needed to use them; states of training runs to resume from. Written whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from imdim.learn.base import BaseConfig, BasePolicy
from imdim.learn.policy import VOCAB, Policy
from imdim.learn.seed import SeedConfig, SeedPolicy
from imdim.program.state import Token

FORMAT, VERSION = "imdim-policy", "1"
VOCABULARY = [Token(i).name for i in range(VOCAB)]
POLICIES: Mapping[str, tuple[type, type]] = {"seed": (SeedPolicy, SeedConfig), "base": (BasePolicy, BaseConfig)}


class CheckpointError(ValueError):
    """A file is no checkpoint that this version reads; the message names the file and the reason."""


def save_policy(path: Path, policy: Policy, notes: Mapping[str, str]) -> None:
    """Weights, version, vocabulary, design and `notes` of a policy of POLICIES. OSError (a full disk) leaves an older file whole."""
    design = next(name for name, (kind, _) in POLICIES.items() if type(policy) is kind)
    header = {
        **notes,
        "format": FORMAT,
        "version": VERSION,
        "vocabulary": json.dumps(VOCABULARY),
        "design": design,
        "config": json.dumps(asdict(policy.config)),  # type: ignore[call-overload]
        "max_seq_len": str(policy.max_seq_len),
    }
    weights = {k: v.detach().cpu().contiguous() for k, v in policy.state_dict().items()}
    replace_whole(path, lambda part: save_file(weights, part, header))


def load_policy(path: Path, device: torch.device | str = "cpu") -> tuple[Policy, dict[str, str]]:
    """The policy in evaluation mode, and the file's header. Raises CheckpointError, OSError when the file cannot be read."""
    if not path.is_file():
        raise FileNotFoundError(f"no checkpoint at {path}")
    try:
        with safe_open(path, framework="pt") as file:
            header = dict(file.metadata() or {})
            weights = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 (not a mapping)
    except SafetensorError as error:
        raise CheckpointError(f"{path}: not a safetensors file: {error}") from error
    _check(path, header)
    kind, config = POLICIES[header["design"]]
    try:
        policy = kind(config(**json.loads(header["config"])), int(header["max_seq_len"]))
        policy.load_state_dict(weights)
    except (TypeError, KeyError, RuntimeError) as error:
        raise CheckpointError(f"{path}: the weights do not fit the design {header['design']}: {error}") from error
    return policy.to(device).eval(), header


def save_state(path: Path, state: Mapping[str, Any]) -> None:
    """A training state: nested dictionaries and lists of tensors and plain values."""
    replace_whole(path, lambda part: torch.save(dict(state), part))


def load_state(path: Path) -> dict[str, Any]:
    """What `save_state` wrote, on the CPU; no code is executed."""
    return torch.load(path, map_location="cpu", weights_only=True)


def replace_whole(path: Path, write: Callable[[Path], Any]) -> None:
    """Let `write` make a file beside `path`, bring it to the disk and put it in place of `path`; nothing is left of a failure."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    try:
        write(part)
        with part.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def _check(path: Path, header: Mapping[str, str]) -> None:
    if header.get("format") != FORMAT:
        raise CheckpointError(f"{path}: not a checkpoint of {FORMAT}, its format is {header.get('format', 'not given')}")
    if header.get("version") != VERSION:
        raise CheckpointError(f"{path}: checkpoint version {header.get('version')}, this program reads version {VERSION}")
    vocabulary = json.loads(header.get("vocabulary", "[]"))
    if vocabulary != VOCABULARY:
        raise CheckpointError(f"{path}: vocabulary {' '.join(vocabulary)}, this program's is {' '.join(VOCABULARY)}")
    if header.get("design") not in POLICIES:
        raise CheckpointError(f"{path}: design {header.get('design')!r}, known are {', '.join(POLICIES)}")


def state_tensors(batch: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The same tensors on the CPU."""
    return {name: tensor.detach().cpu() for name, tensor in batch.items()}
