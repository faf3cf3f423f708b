"""The page's texts: program as a tree and as code, front as a plot, programs as a strip. Clicks in them are passed on to a number input
of the page, which a keyboard reaches too, since the toolkit tells the server of its own inputs only."""

from __future__ import annotations

import base64
import html
import io
import math
import re
from collections.abc import Sequence
from functools import lru_cache

from PIL import Image

from imdim.app.lab.drawing import Colour, colours, names
from imdim.app.lab.edits import Theory, numbers
from imdim.app.lab.solving import TURN, Lock
from imdim.export.openscad import to_openscad
from imdim.export.preview import thumbnail
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.cost import count
from imdim.program.front import Choice
from imdim.program.nary import fold_nary
from imdim.program.tree import OPS, Op, Primitive, Program

PICTURE = 60  # pixels
PICTURE_SEGMENTS = 24
_SHAPE = re.compile(r"\b(cube|sphere|cylinder|rotate_extrude)\(")

# passes the number of what was clicked on to the input with that label, as if it had been typed
_FORWARD = (
    "const r=event.target.closest('[data-n]');if(!r)return;"
    "const l=[...document.querySelectorAll('label')].find(e=>e.textContent==='LABEL');"
    "const i=l&&document.getElementById(l.htmlFor);if(!i)return;"
    "Object.getOwnPropertyDescriptor(HTMLInputElement.prototype,'value').set.call(i,r.dataset.n);"
    "i.dispatchEvent(new Event('input',{bubbles:true}));"
    "for(const ms of [0,50])setTimeout(()=>i.blur(),ms)"  # it takes the focus, and would swallow the keys that the page listens to
)
_BUTTON = "display:block;width:100%;text-align:left;border:0;font:inherit;cursor:pointer;border-radius:4px;padding:2px 4px;margin:1px 0;"


def clickable(label: str, content: str) -> str:
    """HTML whose elements with ``data-n`` set the input called `label` when they are clicked."""
    script = html.escape(_FORWARD.replace("LABEL", label), quote=True)
    return f'<div class="lab-{label.lower()}" style="padding:0 12px 8px" onclick="{script}">{content}</div>'


def tree(theory: Theory | None, selected: int | None, unit: str) -> str:
    """The program as a nested list; each primitive a button that selects it, with its numbers."""
    if theory is None:
        return note("No program yet: press Start, or add a primitive.")
    tints, called = colours(theory.program), names(theory)

    def leaf(i: int, part: Primitive) -> str:
        return _leaf(i, part, called[i], tints[i], i == selected, theory.locks, unit)

    def block(op: Op):
        return lambda parts: (
            f'<div style="color:#495057;font-weight:600">{op}</div><div style="margin-left:2px;padding-left:6px;'
            f'border-left:2px solid #ced4da">{"".join(parts)}</div>'
        )

    body = fold_nary(theory.program, leaf, {op: block(op) for op in OPS})
    return clickable("Primitive", f'<div role="tree" style="font-size:12px;line-height:1.35">{body}</div>')


def _leaf(i: int, part: Primitive, name: str, tint: Colour, selected: bool, locks: frozenset[Lock], unit: str) -> str:
    shown = [n for n in numbers(part) if n.unit == "length" or n.value]
    texts = [f"{n.name}&nbsp;{_number(n.value, n.unit, unit)}{'&#128274;' if Lock(i, n.lock) in locks else ''}" for n in shown]
    back = "#fff3bf" if selected else "#f8f9fa"
    dot = f'<span style="display:inline-block;width:9px;height:9px;border-radius:2px;background:rgb{tint}"></span>'
    return (
        f'<button type="button" role="treeitem" data-n="{i}" aria-selected="{str(selected).lower()}" '
        f'style="{_BUTTON}background:{back};color:#212529">{dot} <b>{i} {html.escape(name)}</b> {part.kind}'
        f'<br><span style="color:#343a40">{", ".join(texts)}</span></button>'
    )


def _number(value: float, of: str, unit: str) -> str:
    text = "0" if abs(value) < 1e-9 else f"{value:.5g}"
    return text + ("°" if of == "degrees" else f"&nbsp;{unit}" if unit else "")


def code(theory: Theory | None, selected: int | None) -> str:
    """The program as OpenSCAD; lines of primitives are buttons that select them."""
    if theory is None:
        return note("No program yet.")
    lines, leaf = [], 0
    for line in to_openscad(theory.program).splitlines():
        text = html.escape(line) or "&nbsp;"
        if not _SHAPE.search(line):
            lines.append(f'<div style="padding:0 4px">{text}</div>')
            continue
        back = "#fff3bf" if leaf == selected else "transparent"
        style = f"{_BUTTON}white-space:pre;background:{back};color:#212529;width:auto;min-width:100%;padding:0 4px;margin:0"
        lines.append(
            f'<button type="button" data-n="{leaf}" aria-pressed="{str(leaf == selected).lower()}" style="{style}">{text}</button>'
        )
        leaf += 1
    body = f'<div style="font:11.5px/1.5 monospace;white-space:pre;overflow-x:auto;color:#343a40">{"".join(lines)}</div>'
    return clickable("Primitive", body)


def strip(choices: Sequence[Choice], shown: Program | None) -> str:
    """Small solids, each a button that loads its program."""
    if not choices:
        return note("Programs appear here as the run goes through them.")
    pictures = "".join(_picture(i, c, shown) for i, c in _numbered(choices))
    return clickable("Choice", f'<div style="display:flex;gap:5px;overflow-x:auto;padding-bottom:4px">{pictures}</div>')


def _picture(i: int, choice: Choice, shown: Program | None) -> str:
    size, error = count(choice.program).primitives, "" if choice.error is None else f", error {choice.error:.2g}"
    title = f"{i}: {size} primitive{'' if size == 1 else 's'}{error}"
    border = "#e67700" if choice.program == shown else "#ced4da"
    return (
        f'<button type="button" data-n="{i}" title="{title}" aria-label="load {title}" style="border:2px solid {border};border-radius:6px;'
        f'background:#fff;padding:1px;cursor:pointer;font:11px sans-serif;color:#212529"><img alt="" width="{PICTURE}" height="{PICTURE}" '
        f'src="{_drawn(choice.program)}"><br>{i}: {size}</button>'
    )


@lru_cache(maxsize=256)
def _drawn(program: Program) -> str:
    """A small picture as a data address; nothing for an empty solid."""
    mesh = to_trimesh(to_manifold(program, PICTURE_SEGMENTS))
    buffer = io.BytesIO()
    picture = thumbnail(mesh, PICTURE) if len(mesh.faces) else Image.new("RGB", (PICTURE, PICTURE), "white")
    picture.save(buffer, "PNG")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def front(choices: Sequence[Choice], shown: Program | None) -> str:
    """Error against size; each point loads its program."""
    known = [(i, count(c.program).primitives, c.error, c.program == shown) for i, c in _numbered(choices) if c.error is not None]
    if not known:
        return note("The front of error against size appears when a run has one.")
    wide, tall, left, low = 300, 190, 44, 30
    sizes, logs = [k[1] for k in known], [math.log10(max(k[2], 1e-6)) for k in known]
    x0, x1, y0, y1 = min(sizes) - 0.5, max(sizes) + 0.5, math.floor(min(logs) - 0.1), math.ceil(max(logs) + 0.1)

    def x(size: float) -> float:
        return left + (size - x0) / (x1 - x0) * (wide - left - 12)

    def y(log: float) -> float:
        return tall - low - (log - y0) / max(y1 - y0, 1) * (tall - low - 12)

    grid = "".join(
        f'<line x1="{left}" x2="{wide - 12}" y1="{y(p):.1f}" y2="{y(p):.1f}" stroke="#dee2e6"/>'
        f'<text x="{left - 5}" y="{y(p) + 4:.1f}" text-anchor="end">1e{p}</text>'
        for p in range(y0, y1 + 1)
    )
    ticks = "".join(f'<text x="{x(s):.1f}" y="{tall - low + 15}" text-anchor="middle">{s}</text>' for s in sorted(set(sizes)))
    path = " ".join(f"{x(s):.1f},{y(log):.1f}" for s, log in sorted(zip(sizes, logs, strict=True)))
    dots = "".join(
        f'<g data-n="{i}" role="button" tabindex="0" style="cursor:pointer" onkeydown="if(event.key===\'Enter\')this.dispatchEvent('
        f"new MouseEvent('click',{{bubbles:true}}))\"><title>{i}: {size} primitives, error {error:.3g}</title>"
        f'<circle cx="{x(size):.1f}" cy="{y(log):.1f}" r="12" fill="transparent"/>'
        f'<circle cx="{x(size):.1f}" cy="{y(log):.1f}" r="6" fill="{"#e67700" if now else "#1864ab"}"/></g>'
        for (i, size, error, now), log in zip(known, logs, strict=True)
    )
    head = (
        f'<svg viewBox="0 0 {wide} {tall}" style="width:100%;font:11px sans-serif;fill:#343a40" role="img" aria-label="error against size">'
    )
    says = "primitives (error upwards); click a point to load it"
    foot = f'<text x="{(wide + left) / 2}" y="{tall - 2}" text-anchor="middle">{says}</text></svg>'
    return clickable("Choice", f'{head}{grid}{ticks}<polyline points="{path}" fill="none" stroke="#74a5d4"/>{dots}{foot}')


def relations(theory: Theory | None, off: Sequence[float], tolerance: float) -> str:
    """The constraints with whether they hold; each a button that puts its number into the input."""
    if theory is None or not theory.constraints:
        return note("No constraints. Add one, or look for relations.")
    rows = "".join(
        f'<button type="button" data-n="{i}" style="{_BUTTON}background:#f8f9fa;color:{"#212529" if far <= tolerance else "#c92a2a"}">'
        f"<b>{i} {html.escape(c.kind)}</b> {html.escape(c.name)}<br>{html.escape(str(c).removeprefix(c.kind + ' of '))}"
        f"{'' if far <= tolerance else f' &#9888; off by {far:.2g}'}</button>"
        for i, (c, far) in enumerate(zip(theory.constraints, off, strict=True))
    )
    return clickable("Constraint", f'<div style="font-size:12px;line-height:1.35">{rows}</div>')


def locked(locks: frozenset[Lock], leaf: int, name: str) -> bool:
    """Whether a number, or the orientation it belongs to, is locked."""
    return Lock(leaf, TURN if name in ("rx", "ry", "rz") else name) in locks


def _numbered(choices: Sequence[Choice]) -> list[tuple[int, Choice]]:
    return list(enumerate(choices, 1))


def note(line: str) -> str:
    """A line of plain text."""
    return f'<div style="padding:4px 12px 8px;font-size:13px;color:#495057">{html.escape(line)}</div>'
