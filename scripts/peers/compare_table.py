"""Rows of a comparison and the tables that they make: per entrant over its parts, and per part."""

from __future__ import annotations

import csv
import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

SUMMARY = (
    "entrant",
    "parts",
    "failed",
    "IoU mean",
    "IoU median",
    "Hausdorff median",
    "primitives median",
    "primitives in all",
    "seconds median",
    "seconds most",
)
EACH = ("part", "entrant", "IoU", "Hausdorff / diagonal", "primitives", "reference", "seconds", "note")


@dataclass
class Row:
    """One entrant on one part. `parts` are primitives, convex parts or faces; `seconds` the wall clock of the command, None where unknown.

    `hausdorff` is relative to the target's diagonal. A failure, whose reason `failure` is, has IoU 0 and an infinite distance.
    """

    entrant: str
    part: str
    iou: float = 0.0
    hausdorff: float = math.inf
    parts: int | None = None
    reference: int | None = None
    seconds: float | None = None
    peak_mib: float | None = None
    note: str = ""
    failure: str = ""


def text(rows: Sequence[Row], title: str) -> str:
    """The whole page: summary, IoU with primitives per part and entrant, and every row."""
    sections = [f"# {title}", summary(rows)]
    shared = common(rows)
    if len(shared) < len({r.part for r in rows}) and shared:
        sections += [f"On the {len(shared)} parts that all have run:", summary([r for r in rows if r.part in shared])]
    sections += ["IoU (primitives), `-` for a failure:", wide(rows), "Every row:", long(rows)]
    return "\n\n".join(sections) + "\n"


def common(rows: Sequence[Row]) -> set[str]:
    """The parts that every entrant has a row for."""
    return set.intersection(*({r.part for r in rows if r.entrant == entrant} for entrant in entrants(rows)))


def entrants(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(r.entrant for r in rows))


def summary(rows: Sequence[Row]) -> str:
    """One line per entrant; failures count with IoU 0, an infinite distance and their time. They have no primitives, and no sum."""
    return table(SUMMARY, [_summed(entrant, [r for r in rows if r.entrant == entrant]) for entrant in entrants(rows)])


def _summed(entrant: str, rows: Sequence[Row]) -> list[str]:
    failed = sum(bool(r.failure) for r in rows)
    ious, far = [r.iou for r in rows], [r.hausdorff for r in rows]
    parts = [r.parts for r in rows if r.parts is not None]
    seconds = [r.seconds for r in rows if r.seconds is not None]
    cells = [entrant, str(len(rows)), str(failed), _four(statistics.fmean(ious)), _four(statistics.median(ious))]
    cells += [_four(statistics.median(far)), _of(statistics.median, parts, "g"), "" if failed else _of(sum, parts, "d")]
    return [*cells, _of(statistics.median, seconds, ".1f"), _of(max, seconds, ".1f")]


def wide(rows: Sequence[Row]) -> str:
    """One line per part, one column per entrant."""
    names = entrants(rows)
    at = {(r.part, r.entrant): "-" if r.failure else f"{r.iou:.3f} ({_count(r.parts)})" for r in rows}
    parts = sorted({r.part for r in rows})
    return table(("part", *names), [[part, *(at.get((part, name), "") for name in names)] for part in parts])


def long(rows: Sequence[Row]) -> str:
    """One line per row."""
    lines = []
    for r in sorted(rows, key=lambda r: r.part):
        seconds = "" if r.seconds is None else f"{r.seconds:.1f}"
        numbers = [_four(r.iou), _four(r.hausdorff), _count(r.parts), _count(r.reference), seconds]
        lines.append([r.part, r.entrant, *numbers, f"FAILED: {r.failure}" if r.failure else r.note])
    return table(EACH, lines)


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table in Markdown; a bar within a cell is escaped."""
    marked = (" | ".join(cell.replace("|", "\\|") for cell in line) for line in lines)
    return "\n".join([f"| {' | '.join(head)} |", "| --- " * len(head) + "|", *(f"| {line} |" for line in marked)])


def write_csv(rows: Sequence[Row], path: Path) -> None:
    with path.open("w", newline="") as out:
        writer = csv.DictWriter(out, [f.name for f in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def _four(value: float) -> str:
    return f"{value:.4f}" if math.isfinite(value) else "inf"


def _count(value: int | None) -> str:
    return "" if value is None else str(value)


def _of(what: Callable[[list], float], values: list, form: str) -> str:
    return format(what(values), form) if values else ""
