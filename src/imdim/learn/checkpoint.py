"""Weights in safetensors with what is needed to use them; states of training runs to resume from. Written whole or not at all."""

from __future__ import annotations

import io
import json
import pickle
import re
import struct
import warnings
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor, nn

from imdim.data.solids import VOCABULARY
from imdim.learn.policy import Policy
from imdim.learn.policy_net import BaseConfig, BasePolicy
from imdim.learn.seed_policy import SeedConfig, SeedPolicy
from imdim.learn.stump.net import StumpNet
from imdim.learn.stump.settings import StumpConfig
from imdim.whole_file import replace_whole

FORMAT, STUMP_FORMAT, VERSION = "imdim-policy", "imdim-stump", "1"
POLICIES: Mapping[str, tuple[type, type]] = {"seed": (SeedPolicy, SeedConfig), "base": (BasePolicy, BaseConfig)}

LARGEST = 1_000_000  # of any number of a design
NO_WIDTHS = ("gt_points", "cur_points", "cloud", "points", "neighbours")  # what no weights belong to
SLACK = 4  # a layer has more than width ** 2 / SLACK weights
N = TypeVar("N", bound=nn.Module)
C = TypeVar("C")
# what torch's reader raises on files that are broken or of another kind
STATE_ERRORS = (
    *(RuntimeError, EOFError, pickle.UnpicklingError, ValueError, KeyError, IndexError, TypeError, AttributeError),
    *(struct.error, AssertionError, OverflowError, MemoryError, RecursionError, zipfile.BadZipFile),
    OSError,  # a seek to where nothing can be
)


class CheckpointError(ValueError):
    """A file is no checkpoint that this version reads; the message names the file and the reason."""


def save_net(path: Path, net: Policy | StumpNet, notes: Mapping[str, str]) -> None:
    """Weights, version, settings and `notes`; of a policy of POLICIES vocabulary and design too. OSError (a full disk) leaves an older
    file whole."""
    header = {**notes, "version": VERSION, "config": json.dumps(asdict(net.config))}  # type: ignore[call-overload]
    if isinstance(net, StumpNet):
        header["format"] = STUMP_FORMAT
    else:
        design = next(name for name, (kind, _) in POLICIES.items() if type(net) is kind)
        header |= {"format": FORMAT, "vocabulary": json.dumps(list(VOCABULARY)), "design": design, "max_seq_len": str(net.max_seq_len)}
    replace_whole(path, _serialise({k: v.detach().cpu().contiguous() for k, v in net.state_dict().items()}, header))


def _serialise(weights: dict[str, torch.Tensor], header: dict[str, str]) -> bytes:
    """A safetensors file with sorted metadata: the library writes them in an order that changes from process to process."""
    raw = save(weights, header)
    length = int.from_bytes(raw[:8], "little")
    described = json.loads(raw[8 : 8 + length])
    described["__metadata__"] = dict(sorted(described["__metadata__"].items()))
    text = json.dumps(described, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)  # the tensors begin at a multiple of eight bytes
    return len(text).to_bytes(8, "little") + text + raw[8 + length :]


def load_stump(path: Path) -> tuple[StumpNet, dict[str, str]]:
    """The CSG-Stump Net in evaluation mode, and the file's header. Raises as `load_policy` does."""
    header, weights = _read(path, STUMP_FORMAT)
    net = _build_net(path, weights, "a CSG-Stump Net", lambda: StumpNet(_config(StumpConfig, header, weights)))
    return net.eval(), header


def load_policy(path: Path, device: torch.device | str = "cpu") -> tuple[Policy, dict[str, str]]:
    """The policy in evaluation mode, and the file's header. Raises CheckpointError, OSError when the file cannot be read."""
    header, weights = _read(path, FORMAT)
    if header.get("vocabulary") != json.dumps(list(VOCABULARY)):
        given = re.sub(r'["\[\],]+', " ", str(header.get("vocabulary")))  # a list in JSON as it is read aloud
        raise CheckpointError(f"{path}: vocabulary {_short(given)}, this program's is {' '.join(VOCABULARY)}")
    if header.get("design") not in POLICIES:
        raise CheckpointError(f"{path}: design {_short(repr(header.get('design')))}, known are {', '.join(POLICIES)}")
    kind, config = POLICIES[header["design"]]
    policy = _build_net(
        path, weights, f"the design {header['design']}", lambda: kind(_config(config, header, weights), int(header["max_seq_len"]))
    )
    return policy.to(device).eval(), header


def load_weights(net: Policy | StumpNet, path: Path) -> None:
    """Give a net the weights of a checkpoint of its design and settings. Raises CheckpointError for one of others, OSError when the file
    cannot be read."""
    given = load_stump(path)[0] if isinstance(net, StumpNet) else load_policy(path)[0]
    mine, its = (asdict(n.config) for n in (net, given))  # type: ignore[call-overload]
    other = [f"{key} {its.get(key)}" for key in mine if its.get(key) != mine[key]] if type(given) is type(net) else ["another design"]
    if other:
        raise CheckpointError(f"{path}: weights of other settings: {_short(', '.join(other))}")
    net.load_state_dict(given.state_dict())


def save_state(path: Path, state: Mapping[str, Any]) -> None:
    """A training state: nested dictionaries and lists of tensors and plain values."""
    # torch and safetensors report a full disk as errors of other kinds, so they write to memory
    buffer = io.BytesIO()
    torch.save(dict(state), buffer)
    replace_whole(path, buffer.getbuffer())


def load_state(path: Path) -> dict[str, Any]:
    """What `save_state` wrote, on the CPU; no code is executed. Raises CheckpointError for another file, FileNotFoundError for none."""
    if not path.is_file():
        raise FileNotFoundError(f"no training state at {path}")
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


def _read(path: Path, form: str) -> tuple[dict[str, str], dict[str, Tensor]]:
    """Header and weights of a safetensors file of this format and version."""
    if not path.is_file():
        raise FileNotFoundError(f"no checkpoint at {path}")
    try:
        with safe_open(path, framework="pt") as file:
            header, weights = dict(file.metadata() or {}), {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 (not a mapping)
    except SafetensorError as error:
        raise CheckpointError(f"{path}: not a safetensors file: {_short(error)}") from error
    if header.get("format") != form:
        raise CheckpointError(f"{path}: not a checkpoint of {form}, its format is {_short(header.get('format', 'not given'))}")
    if header.get("version") != VERSION:
        raise CheckpointError(f"{path}: checkpoint version {_short(header.get('version'))}, this program reads version {VERSION}")
    return header, weights


def _build_net(path: Path, weights: Mapping[str, Tensor], what: str, build: Callable[[], N]) -> N:
    """A net with these weights."""
    try:
        net = build()
        net.load_state_dict(dict(weights))
    except (TypeError, KeyError, ValueError, RuntimeError, OverflowError, AssertionError, AttributeError) as error:
        raise CheckpointError(f"{path}: the weights do not fit {what}: {_short(error)}") from error
    return net


def _config(kind: type[C], header: Mapping[str, str], weights: Mapping[str, Tensor]) -> C:
    """The settings of a design; ValueError for what none can have, and for a net much larger than its weights: none is built."""
    given, default = json.loads(header["config"]), kind()
    for name, value in given.items():
        known = getattr(default, name)
        if type(value) is not type(known) and not (isinstance(known, float) and type(value) is int):
            raise ValueError(f"{name[:40]} cannot be {_short(value)}")
        if type(value) is int and not 0 <= value <= LARGEST:
            raise ValueError(f"{name[:40]} cannot be {value}")
    sizes = {name: value for name, value in given.items() if type(value) is int and name not in NO_WIDTHS}
    layers = sum(value for name, value in sizes.items() if "layers" in name)
    width = max((value for name, value in sizes.items() if "layers" not in name), default=0)
    there = sum(tensor.numel() for tensor in weights.values())
    if max(layers, 1) * width**2 > SLACK * there or int(header.get("max_seq_len", 0)) * width > SLACK * there:
        raise ValueError(f"a net {width} wide needs more than {there} numbers")
    return kind(**given)


def _short(text: object) -> str:
    line = " ".join(str(text).split())
    return line if len(line) <= 160 else line[:157] + "..."
