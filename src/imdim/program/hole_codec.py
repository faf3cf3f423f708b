"""The nodes of holes in a program document: what primitives make together, as a drawing says it.

The primitives are the solid; a hole follows from them. So its node is written anew whenever the program is, and changed by the names of
its numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast, get_args

from imdim.program import fields
from imdim.program.hole_groups import HoleGroup, describe_pattern
from imdim.program.holes import HoleKind
from imdim.program.metric import screw_of
from imdim.program.tree import Program, leaves

MAX_HOLES = 10_000
MAX_WORDS = 200  # characters
DIGITS = 9
HOLE_KINDS: tuple[str, ...] = get_args(HoleKind)


@dataclass(frozen=True, slots=True)
class HoleFeature:
    """Equal holes of one `kind` that the primitives `of` make: the diameter of the bore, across flats of a hexagon; its depth, or
    "through"; diameter and depth of a `head`, if it has one; what metric `screw` it is for, and the `pattern` that `count` of them stand
    in."""

    kind: HoleKind
    diameter: float
    depth: float | Literal["through"]
    count: int
    of: tuple[int, ...]
    head: tuple[float, float] | None = None
    screw: str = ""
    pattern: str = ""

    @staticmethod
    def of_group(group: HoleGroup) -> HoleFeature:
        hole = group.holes[0]
        head, screw = hole.head, screw_of(hole)
        sunk = None if head is None or head is hole.bore else (_round(head.diameter), _round(head.end))
        depth = "through" if hole.through else _round(hole.depth)
        said = "" if screw is None else f"{screw.size} {screw.use}"
        return HoleFeature(
            hole.kind, _round(hole.bore.diameter), depth, len(group.holes), group.leaves, sunk, said, describe_pattern(group)
        )


def hole_node(hole: HoleFeature) -> dict[str, Any]:
    """The node of a hole."""
    head = {} if hole.head is None else {"head_diameter": hole.head[0], "head_depth": hole.head[1]}
    words = {key: text for key, text in (("screw", hole.screw), ("pattern", hole.pattern)) if text}
    return {"kind": hole.kind, "diameter": hole.diameter, "depth": hole.depth, **head, **words, "count": hole.count, "of": list(hole.of)}


def read_holes(entries: object, program: Program) -> tuple[HoleFeature, ...]:
    """The holes of a document with `program`; raises a one-line ValueError that names the path and the number or word at fault."""
    if not isinstance(entries, list) or len(entries) > MAX_HOLES:
        raise ValueError(f"$.holes: expected a list of at most {MAX_HOLES}, got {fields.show(entries)}")
    count = sum(1 for _ in leaves(program))
    return tuple(_read_hole(entry, f"$.holes[{i}]", count) for i, entry in enumerate(entries))


def _read_hole(entry: object, path: str, primitives: int) -> HoleFeature:
    more = ("head_diameter", "head_depth", "screw", "pattern")
    given = fields.record(entry, path, ("kind", "diameter", "depth", "count", "of"), more)
    kind = cast(HoleKind, fields.choice(given["kind"], f"{path}.kind", HOLE_KINDS))
    depth = given["depth"] if given["depth"] == "through" else fields.number(given["depth"], f"{path}.depth")
    if ("head_diameter" in given) != ("head_depth" in given):
        raise ValueError(f"{path}: a head has a diameter and a depth")
    sizes = [fields.number(given[key], f"{path}.{key}") for key in ("diameter", "head_diameter", "head_depth") if key in given]
    if min(sizes) <= 0 or (depth != "through" and depth <= 0):
        raise ValueError(f"{path}: a hole needs positive sizes")
    of = given["of"]
    if not isinstance(of, list) or not of or not all(type(leaf) is int and 0 <= leaf < primitives for leaf in of):
        raise ValueError(f"{path}.of: expected numbers of the {primitives} primitives, got {fields.show(of)}")
    if type(given["count"]) is not int or given["count"] < 1:
        raise ValueError(f"{path}.count: expected a whole number of 1 or more, got {fields.show(given['count'])}")
    words = [given.get(key, "") for key in ("screw", "pattern")]
    if not all(isinstance(text, str) and len(text) <= MAX_WORDS for text in words):
        raise ValueError(f"{path}: expected words of at most {MAX_WORDS} characters")
    head = (sizes[1], sizes[2]) if len(sizes) == 3 else None
    return HoleFeature(kind, sizes[0], cast("float | Literal['through']", depth), given["count"], tuple(of), head, *words)


def find_stale(written: Sequence[HoleFeature], made: Sequence[HoleFeature]) -> int | None:
    """The number of the first hole of a document that its primitives do not make as it says; None where they make all."""
    pairs = zip(written, (*made, *(None for _ in written)), strict=False)
    return next((i for i, (one, other) in enumerate(pairs) if one != other), None)


def _round(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
