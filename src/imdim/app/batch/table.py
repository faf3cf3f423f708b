"""The outcomes as a table: ``results.csv`` for programs, ``results.html`` for people."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from html import escape
from pathlib import Path
from urllib.parse import quote

from imdim.app.batch.folder import LOG, OUTCOME, PARTS, Outcome, Part, to_line, write_whole

REFRESH_S = 10
LINKS = {"OpenSCAD": "program.scad", "STEP": "program.step", "mesh": "mesh.stl", "report": "report.json", "log": LOG}
SIZES, DRAWN_SIZES = ("primitives",), ("features", "curves")  # the latter where a program has outlines
SCORES = ("volume IoU", "exact", "left out", "mean distance / diagonal", "seconds", "peak MiB")
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # how spreadsheets tell formulas
STYLE = (
    "body{font:14px system-ui,sans-serif;margin:2em}table{border-collapse:collapse}th,td{padding:.3em .8em;border-bottom:1px solid #ddd;"
    "text-align:left}td.n{text-align:right;font-variant-numeric:tabular-nums}tr.failed{background:#fdecea}tr.waiting{color:#888}"
    "img{height:90px}a{margin-right:.6em}"
)


def write_tables(out: Path, parts: Sequence[Part], outcomes: Mapping[str, Outcome], status: str, running: bool) -> None:
    """Both tables, whole; the page reloads itself while `running`."""
    names = [f.name for f in fields(Outcome)]
    rows = ([getattr(outcomes[p.name], name) for name in names] for p in parts if p.name in outcomes)
    write_whole(out / "results.csv", csv_text(names, rows))
    write_whole(out / "results.html", html_text(out, parts, outcomes, status, running))


def csv_text(names: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table with a head of `names`. Texts that a spreadsheet would take for formulas begin with an apostrophe."""
    text = io.StringIO()
    csv.writer(text).writerows((names, *([_plain_cell(cell) for cell in row] for row in rows)))
    return text.getvalue()


def _plain_cell(cell: object) -> object:
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell


def html_text(out: Path, parts: Sequence[Part], outcomes: Mapping[str, Outcome], status: str, running: bool) -> str:
    """One row per part, waiting ones too, with pictures and links relative to `out`. Nothing is loaded from elsewhere."""
    sizes = DRAWN_SIZES if any(outcome.curves for outcome in outcomes.values()) else SIZES
    refresh = f'<meta http-equiv="refresh" content="{REFRESH_S}">' if running else ""
    head = "".join(f"<th>{escape(c)}</th>" for c in ("picture", "part", *sizes, *SCORES, "how it ended", "files"))
    rows = "\n".join(_row(out, outcomes[p.name], sizes) if p.name in outcomes else _waiting(p, sizes) for p in parts)
    title = f"<title>{escape(status)}</title><style>{STYLE}</style>"
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">{refresh}{title}</head>\n'
        f"<body><h1>Batch</h1><p>{escape(status)}</p>\n<table><thead><tr>{head}</tr></thead><tbody>\n{rows}\n</tbody></table></body></html>\n"
    )


def _row(out: Path, outcome: Outcome, sizes: Sequence[str]) -> str:
    picture = f'<a href="{_link(outcome, "preview.png")}"><img loading="lazy" alt="" src="{_link(outcome, "preview.png")}"></a>'
    there = [(what, file) for what, file in {**LINKS, "record": OUTCOME}.items() if (out / PARTS / outcome.part / file).is_file()]
    links = "".join(f'<a href="{_link(outcome, file)}">{what}</a>' for what, file in there)
    numbers = (
        *(_number(size, "d") for size in (outcome.primitives, outcome.curves)[: len(sizes)]),
        _number(outcome.volume_iou, ".4f"),
        _number(outcome.exact, ".1%"),
        _number(outcome.left_out, ".1%"),
        _number(outcome.mean_distance, ".2e"),
        _number(outcome.seconds, ".1f"),
        _number(outcome.peak_mib, ".0f"),
    )
    cells = "".join(f'<td class="n">{n}</td>' for n in numbers)
    return (
        f'<tr class="{"failed" if outcome.failure else "done"}"><td>{"" if outcome.failure else picture}</td>'
        f"<td>{escape(to_line(outcome.input))}</td>{cells}<td>{escape(to_line(outcome.failure or outcome.stop))}</td><td>{links}</td></tr>"
    )


def _waiting(part: Part, sizes: Sequence[str]) -> str:
    blank = "<td></td>" * len((*sizes, *SCORES))
    return f'<tr class="waiting"><td></td><td>{escape(to_line(part.source.name))}</td>{blank}<td>waiting</td><td></td></tr>'


def _link(outcome: Outcome, file: str) -> str:
    return escape(quote(f"{PARTS}/{outcome.part}/{file}".encode("utf-8", "surrogateescape")))


def _number(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)
