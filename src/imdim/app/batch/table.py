"""The outcomes as a table: ``results.csv`` for programs, ``results.html`` for people."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from html import escape
from pathlib import Path
from urllib.parse import quote

from imdim.app.batch.folder import LOG, OUTCOME, PARTS, Outcome, Part, to_line
from imdim.whole_file import write_text_whole

REFRESH_S = 10
LINKS = {
    "report": "report.html",
    "OpenSCAD": "program.scad",
    "STEP": "program.step",
    "FreeCAD": "program.FCMacro",
    "mesh": "mesh.stl",
    "measured values": "report.json",
    "log": LOG,
    "outcome": OUTCOME,
}
SIZES, DRAWN_SIZES = ("primitives",), ("features", "curves")  # the latter where a program has outlines
SCORES = ("volume IoU", "exact", "left out", "mean distance / diagonal", "seconds", "memory (MiB)")
GOOD_IOU, FAIR_IOU = 0.99, 0.95  # from which a fit is green, and amber; below it is red
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # how spreadsheets tell formulas
STYLE = """
body { font: 14px system-ui, sans-serif; margin: 1.5em; color: #212529 }
.wide { overflow-x: auto }
table { border-collapse: collapse; width: 100% }
th, td { padding: .3em .6em; border-bottom: 1px solid #dee2e6; text-align: left; vertical-align: middle }
th button { font: inherit; font-weight: 600; border: 0; background: none; padding: 0; cursor: pointer; color: #1864ab; text-align: left }
th[aria-sort=ascending] button::after { content: " \\25b2" }
th[aria-sort=descending] button::after { content: " \\25bc" }
td.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap }
td.name { overflow-wrap: anywhere; min-width: 8em; font-weight: 600 }
td.good { background: #d3f9d8 } td.fair { background: #fff3bf } td.poor { background: #ffc9c9 }
tr.failed { background: #fff0f0 } tr.waiting { color: #5c636a }
img { height: 72px } td a { margin-right: .6em }
@media (max-width: 60em) {
  body { margin: .8em }
  thead tr { display: flex; flex-wrap: wrap; gap: .3em .9em } thead th { border: 0; padding: 0 }
  table, thead, tbody, tbody tr, td { display: block }
  tbody tr { border: 1px solid #ced4da; border-radius: 8px; margin: .7em 0; padding: .4em }
  td { border: 0; padding: .12em .4em } td:empty, td.n:empty { display: none }
  td.n:not(:empty) { text-align: left; display: inline-block } td.n::before { content: attr(data-is) ": "; color: #495057 }
  td a { display: inline-block; padding: .35em 0 }
}
"""
# sorts by the column that is pressed, once more the other way; the address keeps it while the page reloads itself
SCRIPT = """
const body = document.querySelector('tbody'), heads = [...document.querySelectorAll('th')], first = [...body.rows];
const key = (row, i) => { const v = row.cells[i].dataset.v ?? row.cells[i].textContent.trim().toLowerCase(); return v === '' ? null : v; };
function sort(i, down) {
  const rows = [...first].sort((a, b) => {
    const [x, y] = [key(a, i), key(b, i)];
    if (x === null || y === null) return (x === null) - (y === null);
    const order = isNaN(x) || isNaN(y) ? String(x).localeCompare(String(y)) : x - y;
    return down ? -order : order; });
  body.append(...rows);
  heads.forEach((h, k) => k === i ? h.setAttribute('aria-sort', down ? 'descending' : 'ascending') : h.removeAttribute('aria-sort'));
  history.replaceState(null, '', `#${i},${down ? 1 : 0}`); }
heads.forEach((h, i) => h.querySelector('button')?.addEventListener('click', () => sort(i, h.getAttribute('aria-sort') === 'ascending')));
const kept = location.hash.match(/^#(\\d+),([01])$/);
if (kept && heads[kept[1]]?.querySelector('button')) sort(Number(kept[1]), kept[2] === '1');
"""


def write_tables(out: Path, parts: Sequence[Part], outcomes: Mapping[str, Outcome], status: str, running: bool) -> None:
    """Both tables, whole; the page reloads itself while `running`."""
    names = [f.name for f in fields(Outcome)]
    rows = ([getattr(outcomes[p.name], name) for name in names] for p in parts if p.name in outcomes)
    write_text_whole(out / "results.csv", csv_text(names, rows))
    write_text_whole(out / "results.html", html_text(out, parts, outcomes, status, running))


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
    columns = ("part", *sizes, *SCORES, "how it ended")
    head = "".join(f'<th scope="col"><button type="button">{escape(c)}</button></th>' for c in columns)
    rows = "\n".join(_row(out, outcomes[p.name], sizes) if p.name in outcomes else _waiting(p, sizes) for p in parts)
    title = f'<meta name="viewport" content="width=device-width, initial-scale=1"><title>{escape(status)}</title><style>{STYLE}</style>'
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">{refresh}{title}</head>\n'
        f'<body><h1>Batch</h1><p>{escape(status)}</p>\n<div class="wide"><table><thead><tr><th scope="col">picture</th>{head}'
        f'<th scope="col">files</th></tr></thead><tbody>\n{rows}\n</tbody></table></div>'
        f"<script>{SCRIPT}</script></body></html>\n"
    )


def _row(out: Path, outcome: Outcome, sizes: Sequence[str]) -> str:
    there = [(what, file) for what, file in LINKS.items() if (out / PARTS / outcome.part / file).is_file()]
    opened = "report.html" if ("report", "report.html") in there else "preview.png"
    picture = f'<a href="{_link(outcome, opened)}"><img loading="lazy" alt="" src="{_link(outcome, "preview.png")}"></a>'
    links = "".join(f'<a href="{_link(outcome, file)}">{what}</a>' for what, file in there)
    sized = zip(sizes, (outcome.primitives, outcome.curves), strict=False)
    cells = [_number(name, size, "d") for name, size in sized]
    scores = (
        (outcome.volume_iou, ".4f", _judge(outcome.volume_iou)),
        (outcome.exact, ".1%", ""),
        (outcome.left_out, ".1%", ""),
        (outcome.mean_distance, ".2e", ""),
        (outcome.seconds, ".1f", ""),
        (outcome.peak_mib, ".0f", ""),
    )
    cells += [_number(name, *score) for name, score in zip(SCORES, scores, strict=True)]
    ended = outcome.failure or outcome.stop.replace("_", " ")
    return (
        f'<tr class="{"failed" if outcome.failure else "done"}"><td>{"" if outcome.failure else picture}</td>'
        f'<td class="name">{escape(to_line(outcome.input))}</td>{"".join(cells)}<td>{escape(to_line(ended))}</td><td>{links}</td></tr>'
    )


def _waiting(part: Part, sizes: Sequence[str]) -> str:
    blank = "<td></td>" * len((*sizes, *SCORES))
    return f'<tr class="waiting"><td></td><td>{escape(to_line(part.source.name))}</td>{blank}<td>waiting</td><td></td></tr>'


def _link(outcome: Outcome, file: str) -> str:
    return escape(quote(f"{PARTS}/{outcome.part}/{file}".encode("utf-8", "surrogateescape")))


def _judge(iou: float | None) -> str:
    """How well a fit is, by the volume that it shares with the part."""
    return "" if iou is None else "good" if iou >= GOOD_IOU else "fair" if iou >= FAIR_IOU else "poor"


def _number(name: str, value: float | None, form: str, judged: str = "") -> str:
    """A cell, which says what it is where there is no head, and its value for sorting."""
    if value is None:
        return '<td class="n"></td>'
    return f'<td class="{f"n {judged}".strip()}" data-is="{name}" data-v="{value}">{format(value, form)}</td>'
