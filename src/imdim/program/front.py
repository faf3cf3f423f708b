"""front.json: programs of one target from crude to exact, each a whole document, so that any of them can be chosen and exported."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from imdim.program.codec import Meta, meta_of, parse, to_json
from imdim.program.codec import from_json as program_from_json
from imdim.program.cost import count
from imdim.program.tree import Program

FORMAT, VERSION = "imdim-front", 1


@dataclass(frozen=True)
class Choice:
    """A program and its `error`, None if it was not measured: volume in which it differs from the target, relative to the target's."""

    program: Program
    error: float | None = None


def dumps(choices: Sequence[Choice], meta: Meta | None = None, picked: int | None = None) -> str:
    """The text, choices from crude to exact; `picked` is the number (from 1) of the one that was delivered, if it is among them."""
    entries = [_entry(i, choice, meta) for i, choice in enumerate(choices, 1)]
    head = {"format": FORMAT, "version": VERSION, "picked": picked}
    lines = [f"  {json.dumps(key)}: {json.dumps(value)}," for key, value in head.items()]
    body = ",\n".join("    " + json.dumps(entry, allow_nan=False) for entry in entries)
    return "{\n" + "\n".join(lines) + f'\n  "choices": [\n{body}\n  ]\n}}\n'


def _entry(number: int, choice: Choice, meta: Meta | None) -> dict[str, Any]:
    counts = count(choice.program)
    return {
        "pick": number,
        "primitives": counts.primitives,
        "operations": counts.operations,
        **counts.drawn,
        "error": None if choice.error is None else float(f"{choice.error:.6g}"),
        "document": to_json(choice.program, meta),
    }


def loads(text: str | bytes) -> tuple[list[Choice], Meta]:
    """The choices of a text and what their numbers mean; raises a one-line ValueError that names the JSON path at fault."""
    return from_json(parse(text))


def from_json(document: object) -> tuple[list[Choice], Meta]:
    """As `loads`, for a document that was parsed already."""
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise ValueError(f"$.format: expected {FORMAT!r}")
    if document.get("version") != VERSION:
        raise ValueError(f"$.version: expected {VERSION}, got {document.get('version')!r}")
    entries = document.get("choices")
    if not isinstance(entries, list) or not entries:
        raise ValueError("$.choices: expected a list of at least one choice")
    return [_read(entry, i) for i, entry in enumerate(entries)], meta_of(entries[0]["document"])


def _read(entry: object, i: int) -> Choice:
    if not isinstance(entry, dict) or not {"error", "document"} <= entry.keys() or not isinstance(entry["error"], int | float | None):
        raise ValueError(f"$.choices[{i}]: expected an error and a document")
    try:
        return Choice(program_from_json(entry["document"]), entry["error"])
    except ValueError as error:
        raise ValueError(f"$.choices[{i}].document{str(error).removeprefix('$')}") from None
