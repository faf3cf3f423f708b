"""Weights in safetensors with what is needed to use them; states of training runs to resume from. Written whole or not at all."""

from __future__ import annotations

import io
import json
import os
import pickle
import struct
import warnings
import zipfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from imdim.learn.base import BaseConfig, BasePolicy
from imdim.learn.policy import VOCAB, Policy
from imdim.learn.seed import SeedConfig, SeedPolicy
from imdim.learn.stump.net import StumpNet
from imdim.learn.stump.settings import StumpConfig
from imdim.program.state import Token

FORMAT, VERSION = "imdim-policy", "1"
STUMP_FORMAT, STUMP_VERSION = "imdim-stump", "1"
VOCABULARY = [Token(i).name for i in range(VOCAB)]
POLICIES: Mapping[str, tuple[type, type]] = {"seed": (SeedPolicy, SeedConfig), "base": (BasePolicy, BaseConfig)}

# what torch's reader raises on files that are broken or of another kind
STATE_ERRORS = (
    *(RuntimeError, EOFError, pickle.UnpicklingError, ValueError, KeyError, IndexError, TypeError, AttributeError),
    *(struct.error, AssertionError, OverflowError, MemoryError, RecursionError, zipfile.BadZipFile),
)


class CheckpointError(ValueError):
    """A file is no checkpoint that this version reads; the message names the file and the reason."""


def save_net(path: Path, net: Policy | StumpNet, notes: Mapping[str, str]) -> None:
    """`save_policy`, or the same of a CSG-Stump Net, which has no vocabulary."""
    if isinstance(net, StumpNet):
        header = {"format": STUMP_FORMAT, "version": STUMP_VERSION, "config": json.dumps(asdict(net.config))}
        replace_whole(path, save(_weights(net), {**notes, **header}))
    else:
        save_policy(path, net, notes)


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
    replace_whole(path, save(_weights(policy), header))


def load_stump(path: Path, device: torch.device | str = "cpu") -> tuple[StumpNet, dict[str, str]]:
    """The CSG-Stump Net in evaluation mode, and the file's header. Raises as `load_policy` does."""
    header, weights = _read(path)
    _check_format(path, header, STUMP_FORMAT, STUMP_VERSION)
    try:
        net = StumpNet(StumpConfig(**json.loads(header["config"])))
        net.load_state_dict(weights)
    except (TypeError, KeyError, RuntimeError) as error:
        raise CheckpointError(f"{path}: the weights do not fit a CSG-Stump Net: {error}") from error
    return net.to(device).eval(), header


def load_policy(path: Path, device: torch.device | str = "cpu") -> tuple[Policy, dict[str, str]]:
    """The policy in evaluation mode, and the file's header. Raises CheckpointError, OSError when the file cannot be read."""
    header, weights = _read(path)
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
    buffer = io.BytesIO()
    torch.save(dict(state), buffer)
    replace_whole(path, buffer.getbuffer())


def load_state(path: Path) -> dict[str, Any]:
    """What `save_state` wrote, on the CPU; no code is executed. Raises CheckpointError for another file."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of what other pickles hold; they are refused
            return torch.load(path, map_location="cpu", weights_only=True)
    except STATE_ERRORS as error:
        raise CheckpointError(f"{path}: not a training state") from error


def load_own_state(path: Path, settings: Mapping[str, object]) -> dict[str, Any]:
    """The state of a run with these `settings`, which it notes under "config"; settings that it does not know may be any.

    Raises FileNotFoundError, CheckpointError, ValueError when the settings are others.
    """
    if not path.is_file():
        raise FileNotFoundError(f"nothing to resume: no {path}")
    state = load_state(path)
    if not isinstance(state, dict) or not {"step", "best", "config", "policy", "average", "optimizer"} <= state.keys():
        raise CheckpointError(f"{path}: not the state of a training run")
    other = [key for key, value in settings.items() if key in state["config"] and state["config"][key] != value]
    if other:
        raise ValueError(f"{path} is of a run with another {', '.join(other)}")
    return state


def replace_whole(path: Path, content: bytes | memoryview) -> None:
    """Write a file beside `path`, bring it to the disk and put it in place of `path`; nothing is left of a failure."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    try:
        # torch and safetensors report a full disk as errors of other kinds, so they write to memory
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        raise type(error)(error.errno, error.strerror, str(path)) from error
    finally:
        part.unlink(missing_ok=True)


def _weights(net: Policy | StumpNet) -> dict[str, Tensor]:
    return {k: v.detach().cpu().contiguous() for k, v in net.state_dict().items()}


def _read(path: Path) -> tuple[dict[str, str], dict[str, Tensor]]:
    """Header and weights of a safetensors file."""
    if not path.is_file():
        raise FileNotFoundError(f"no checkpoint at {path}")
    try:
        with safe_open(path, framework="pt") as file:
            return dict(file.metadata() or {}), {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 (not a mapping)
    except SafetensorError as error:
        raise CheckpointError(f"{path}: not a safetensors file: {error}") from error


def _check_format(path: Path, header: Mapping[str, str], form: str, version: str) -> None:
    if header.get("format") != form:
        raise CheckpointError(f"{path}: not a checkpoint of {form}, its format is {header.get('format', 'not given')}")
    if header.get("version") != version:
        raise CheckpointError(f"{path}: checkpoint version {header.get('version')}, this program reads version {version}")


def _check(path: Path, header: Mapping[str, str]) -> None:
    _check_format(path, header, FORMAT, VERSION)
    vocabulary = json.loads(header.get("vocabulary", "[]"))
    if vocabulary != VOCABULARY:
        raise CheckpointError(f"{path}: vocabulary {' '.join(vocabulary)}, this program's is {' '.join(VOCABULARY)}")
    if header.get("design") not in POLICIES:
        raise CheckpointError(f"{path}: design {header.get('design')!r}, known are {', '.join(POLICIES)}")


def state_tensors(batch: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The same tensors on the CPU."""
    return {name: tensor.detach().cpu() for name, tensor in batch.items()}
