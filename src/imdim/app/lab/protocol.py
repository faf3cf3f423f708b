"""Messages between the server and the process that works for it: a JSON head and plain arrays, nothing that could run when it is read."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh

from imdim.program import codec
from imdim.program.constraints import Constraint
from imdim.program.front import Choice
from imdim.program.tree import Program
from imdim.target.target import Target

_HEAD = 8  # bytes of the length of the JSON head


@dataclass(frozen=True, eq=False)
class Message:
    """`kind` says what it is, `values` are plain JSON, `arrays` hold numbers or the bytes of files."""

    kind: str
    values: dict[str, Any] = field(default_factory=dict)
    arrays: dict[str, np.ndarray] = field(default_factory=dict)


def pack_message(message: Message) -> bytes:
    """The bytes of a message."""
    head = json.dumps({"kind": message.kind, "values": message.values}, allow_nan=False).encode()
    body = io.BytesIO()
    if message.arrays:
        np.savez(body, **message.arrays)  # type: ignore[arg-type]
    return len(head).to_bytes(_HEAD, "little") + head + body.getvalue()


def unpack_message(data: bytes) -> Message:
    """The message of `data`; raises ValueError where it is none."""
    end = _HEAD + int.from_bytes(data[:_HEAD], "little")
    head = json.loads(data[_HEAD:end])
    arrays: dict[str, np.ndarray] = {}
    if end < len(data):
        with np.load(io.BytesIO(data[end:]), allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    return Message(head["kind"], head["values"], arrays)


def target_message(target: Target) -> Message:
    """A target with its arrays."""
    arrays = {"points": target.points}
    if target.normals is not None:
        arrays["normals"] = target.normals
    if target.scanners is not None:
        arrays["scanners"] = target.scanners
    if target.mesh is not None:
        arrays |= {"vertices": np.asarray(target.mesh.vertices), "faces": np.asarray(target.mesh.faces)}
    return Message("target", {"name": target.name, "is_solid": target.is_solid, "notes": list(target.notes), "units": target.units}, arrays)


def target_of(message: Message) -> Target:
    """The target of a `target_message`."""
    arrays, values = message.arrays, message.values
    mesh = trimesh.Trimesh(arrays["vertices"], arrays["faces"], process=False) if "vertices" in arrays else None
    notes, units, scanners = tuple(values["notes"]), values["units"], arrays.get("scanners")
    return Target(values["name"], arrays["points"], arrays.get("normals"), mesh, values["is_solid"], notes, units, scanners)


def read_document(values: object) -> tuple[Program, tuple[Constraint, ...]]:
    """The program and constraints of a parsed program.json; raises a one-line ValueError."""
    return codec.from_json(values), codec.constraints_of(values)


def front_values(front: Sequence[Choice]) -> list[dict[str, Any]]:
    """Programs from crude to exact as plain values."""
    return [{"error": c.error, "document": codec.to_json(c.program)} for c in front]


def read_front(values: Sequence[Mapping[str, Any]]) -> tuple[Choice, ...]:
    """The programs of `front_values`."""
    return tuple(Choice(codec.from_json(v["document"]), v["error"]) for v in values)
