"""The page's texts: program as a tree and as code, programs as a strip, constraints as a list.

Clicks in them are passed on to a number input of the page that nobody sees, since the toolkit tells the server of its own inputs only.
No two clicks give it the same number, and the server never writes to it: neither a second click on one thing nor one that crosses an
answer is lost.
"""

from __future__ import annotations

import base64
import html
import io
import re
from collections.abc import Callable, Sequence
from functools import lru_cache

import viser
from PIL import Image

from imdim.app.lab.drawing import BLENDED, Colour, colours, names
from imdim.app.lab.edits import ConstrainedProgram, numbers
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.relation_words import say_relation
from imdim.app.lab.solving import Lock
from imdim.export.hole_names import hole_groups
from imdim.export.openscad import OUTLINE, to_openscad
from imdim.export.preview import thumbnail
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.cost import count
from imdim.program.edges import EdgeFeature, describe_edges
from imdim.program.front import Choice
from imdim.program.hole_groups import HoleGroup
from imdim.program.nary import fold_nary
from imdim.program.tree import OPS, Op, Primitive, Program, leaves

PICTURE = 60  # pixels
PICTURE_SEGMENTS = 24
_SHAPE = re.compile(r"\b(cube|sphere|cylinder|rotate_extrude|linear_extrude)\(")

LEFT_OUT = f"// outline(): {OUTLINE.count(chr(10))} lines that draw the loops; the copy has them\n"

CLICKS = 10_000  # numbers that can be clicked on; how often that was done is counted in front of them
# passes the number of what was clicked on to the input with that label, as if it had been typed
_FORWARD = (
    "const r=event.target.closest('[data-n]');if(!r||event.button)return;"
    "const tell=()=>{const n=(window.imdimClicks=(window.imdimClicks||0)+1)*CLICKS+Number(r.dataset.n);"
    "const l=[...document.querySelectorAll('label')].find(e=>e.textContent==='LABEL');"
    "const i=l&&document.getElementById(l.htmlFor);if(!i)return;"
    "Object.getOwnPropertyDescriptor(HTMLInputElement.prototype,'value').set.call(i,n);"
    "i.dispatchEvent(new Event('input',{bubbles:true}));"
    "for(const ms of [0,50])setTimeout(()=>i.blur(),ms)};"  # it takes the focus, and would swallow the keys that the page listens to
)
# while a run goes on these texts are drawn anew several times a second, and a browser tells nobody of a click whose element has gone
# between press and release: the press is remembered. A finger that scrolls ends in `pointercancel`; a key has no press
_NEAR = 9  # pixels that the pointer may move
_PRESSED = (
    f"{_FORWARD}const end=new AbortController(),on=(e,f)=>document.addEventListener(e,f,{{signal:end.signal}});"
    f"on('pointerup',e=>{{end.abort();if(Math.hypot(e.clientX-event.clientX,e.clientY-event.clientY)<{_NEAR})tell()}});"
    "on('pointercancel',()=>end.abort())"
)
_BY_KEY = f"if(event.detail)return;{_FORWARD}tell()"
BUTTON = "display:block;width:100%;text-align:left;border:0;font:inherit;cursor:pointer;border-radius:4px;padding:2px 4px;margin:1px 0;"


def clickable(label: str, content: str) -> str:
    """HTML whose elements with ``data-n`` set the input called `label` when they are clicked."""
    filled = (script.replace("LABEL", label).replace("CLICKS", str(CLICKS)) for script in (_PRESSED, _BY_KEY))
    pressed, by_key = (html.escape(script, quote=True) for script in filled)
    return f'<div class="lab-{label.lower()}" style="padding:0 12px 8px" onpointerdown="{pressed}" onclick="{by_key}">{content}</div>'


def tree(theory: ConstrainedProgram | None, selected: int | None, unit: str) -> str:
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
    first = theory.size - len(theory.edges)
    body += "".join(_edge_feature(first + i, f, first + i == selected) for i, f in enumerate(theory.edges))
    holes = "" if theory.names is None else "".join(_hole(group, selected) for group in _find_holes(theory.program))
    if holes:
        body += f'<div style="color:#495057;font-weight:600;margin-top:6px">holes</div>{holes}'
    return clickable("Primitive", f'<div role="tree" style="font-size:12px;line-height:1.35">{body}</div>')


@lru_cache(maxsize=8)
def _find_holes(program: Program) -> tuple[HoleGroup, ...]:
    return hole_groups(program)


def _hole(group: HoleGroup, selected: int | None) -> str:
    """What a drawing would say of equal holes; a button that selects what makes the first."""
    return (
        f'<button type="button" class="lab-hole" data-n="{group.leaves[0]}" style="{BUTTON}background:{_back(selected in group.leaves)};'
        f'color:#212529">{html.escape(str(group))}</button>'
    )


def _leaf(i: int, part: Primitive, name: str, tint: Colour, selected: bool, locks: frozenset[Lock], unit: str) -> str:
    shown = [n for n in numbers(part) if n.unit == "length" or n.value]
    texts = [f"{n.name}&nbsp;{_number(n.value, n.unit, unit)}{'&#128274;' if Lock(i, n.lock) in locks else ''}" for n in shown]
    dot = f'<span style="display:inline-block;width:9px;height:9px;border-radius:2px;background:rgb{tint}"></span>'
    return (
        f'<button type="button" role="treeitem" data-n="{i}" aria-selected="{str(selected).lower()}" '
        f'style="{BUTTON}background:{_back(selected)};color:#212529">{dot} <b>{i} {html.escape(name)}</b> {part.kind}'
        f'<br><span style="color:#343a40">{", ".join(texts)}</span></button>'
    )


def _edge_feature(number: int, feature: EdgeFeature, selected: bool) -> str:
    dot = f'<span style="display:inline-block;width:9px;height:9px;border-radius:2px;background:rgb{BLENDED}"></span>'
    return (
        f'<button type="button" role="treeitem" data-n="{number}" aria-selected="{str(selected).lower()}" '
        f'style="{BUTTON}background:{_back(selected)};color:#212529">{dot} <b>{describe_edges(feature)}</b></button>'
    )


def _number(value: float, of: str, unit: str) -> str:
    text = "0" if abs(value) < 1e-9 else f"{value:.5g}"
    return text + ("°" if of == "degrees" else f"&nbsp;{unit}" if unit else "")


def code(theory: ConstrainedProgram | None, selected: int | None) -> str:
    """The program as OpenSCAD, as it is downloaded, with a button that copies all of it; lines of primitives are buttons that select them.

    Of the functions that draw outlines a line of comment stands here, the copy has them."""
    if theory is None:
        return note("No program yet.")
    whole = to_openscad(theory.program) if theory.names is None else theory.names.delivered.texts["program.scad"]
    lines, leaf, most = [], 0, len(theory.labels)
    for line in whole.replace(OUTLINE, LEFT_OUT).splitlines():
        text = html.escape(line) or "&nbsp;"
        if leaf == most or not _SHAPE.search(line):
            lines.append(f'<div style="padding:0 4px">{text}</div>')
            continue
        back = "#fff3bf" if leaf == selected else "transparent"
        style = f"{BUTTON}white-space:pre;background:{back};color:#212529;width:auto;min-width:100%;padding:0 4px;margin:0"
        lines.append(
            f'<button type="button" data-n="{leaf}" aria-pressed="{str(leaf == selected).lower()}" style="{style}">{text}</button>'
        )
        leaf += 1
    body = f'<div style="font:11.5px/1.5 monospace;white-space:pre;overflow-x:auto;color:#343a40">{"".join(lines)}</div>'
    return copy_button(whole) + clickable("Primitive", body)


def copy_button(text: str) -> str:
    """A button that puts a text on the clipboard, or selects it where a page may not do that."""
    script = (
        "const t=this.nextElementSibling,b=this,say=(w)=>{b.textContent=w;setTimeout(()=>b.textContent='Copy all',2000)};"
        "const old=()=>{t.style.display='block';t.select();const ok=document.execCommand('copy');t.style.display='none';"
        "say(ok?'Copied':'Not allowed here')};"
        "navigator.clipboard?navigator.clipboard.writeText(t.value).then(()=>say('Copied'),old):old()"
    )
    look = "border:1px solid #ced4da;border-radius:4px;background:#f8f9fa;color:#212529;font:inherit;padding:2px 10px;cursor:pointer"
    return (
        f'<div style="padding:4px 12px 6px;font-size:12px"><button type="button" class="lab-copy" onclick="{html.escape(script)}" '
        f'style="{look}">Copy all</button><textarea readonly class="lab-program" style="display:none">{html.escape(text)}</textarea></div>'
    )


def strip(choices: Sequence[Choice], shown: Program | None) -> str:
    """Small solids, each a button that loads its program."""
    if not choices:
        return note("Programs appear here as the run goes through them.")
    pictures = "".join(_picture(i, c, shown) for i, c in enumerate(choices, 1))
    return clickable("Choice", f'<div style="display:flex;gap:5px;overflow-x:auto;padding-bottom:4px">{pictures}</div>')


def _picture(i: int, choice: Choice, shown: Program | None) -> str:
    counts, error = count(choice.program), "" if choice.error is None else f", error {choice.error:.2g}"
    title = f"{i}: {counts}{error}"
    border = "#e67700" if choice.program == shown else "#ced4da"
    return (
        f'<button type="button" data-n="{i}" title="{title}" aria-label="load {title}" style="border:2px solid {border};border-radius:6px;'
        f'background:#fff;padding:1px;cursor:pointer;font:11px sans-serif;color:#212529"><img alt="" width="{PICTURE}" height="{PICTURE}" '
        f'src="{_render_thumbnail(choice.program)}"><br>{i}: {counts.primitives}</button>'
    )


@lru_cache(maxsize=256)
def _render_thumbnail(program: Program) -> str:
    """A small picture as a data address; nothing for an empty solid."""
    mesh = to_trimesh(to_manifold(program, PICTURE_SEGMENTS))
    return _address(thumbnail(mesh, PICTURE) if len(mesh.faces) else Image.new("RGB", (PICTURE, PICTURE), "white"))


def edit_picture(what: str, picture: Image.Image) -> str:
    """A picture of the part before and after an edit, and below it which side is which."""
    said = html.escape(what)
    return (
        f'<figure class="lab-edit" style="margin:0;padding:4px 12px 8px;font-size:12.5px;color:#495057"><img src="{_address(picture)}" '
        f'width="{picture.width}" height="{picture.height}" style="max-width:100%;height:auto" alt="the part before and after {said}">'
        f'<figcaption style="display:flex"><span style="flex:1">before</span><span style="flex:1">{said}</span></figcaption></figure>'
    )


def _address(picture: Image.Image) -> str:
    buffer = io.BytesIO()
    picture.save(buffer, "PNG")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def relations(theory: ConstrainedProgram | None, off: Sequence[float], tolerance: float, chosen: int, unit: str) -> str:
    """The constraints in words, with whether they hold; each a button that chooses it."""
    if theory is None or not theory.constraints:
        return note("No relations. Add one, or look for relations.")
    labels, parts = theory.labels, list(leaves(theory.program))
    rows = "".join(
        f'<button type="button" data-n="{i}" aria-pressed="{str(i == chosen).lower()}" style="{BUTTON}background:{_back(i == chosen)};'
        f'color:{"#212529" if far <= tolerance else "#c92a2a"}" '
        f'title="{html.escape(str(c))}">{html.escape(say_relation(c, labels, parts, unit))}'
        f"{'' if far <= tolerance else f' &#9888; does not hold, off by {far:.2%} of the part'}</button>"
        for i, (c, far) in enumerate(zip(theory.constraints, off, strict=True))
    )
    return clickable("Constraint", f'<div style="font-size:12px;line-height:1.35">{rows}</div>')


def _back(selected: bool) -> str:
    return "#fff3bf" if selected else "#f8f9fa"


def add_clicks(gui: viser.GuiApi, label: str, queue: InputQueue, clicked: Callable[[int], object]) -> None:
    """The input called `label` that clicks in the texts go through, which nobody sees. `clicked` gets the number of what was clicked on.

    It must not lie in a tab that was never opened: what does is not in the page.
    """
    gui.add_html('<i class="lab-unseen"></i>')
    queue.watch(gui.add_number(label, 0, step=1), lambda number: clicked(int(number) % CLICKS))


def add_texts(gui: viser.GuiApi, label: str, queue: InputQueue, typed: Callable[[str], object]) -> None:
    """The input called `label` that scripts of the page write into, which nobody sees. `typed` gets the text after its count."""
    gui.add_html(f'<i class="lab-unseen" data-to="{label}"></i>')
    queue.watch(gui.add_text(label, ""), lambda text: typed(text.partition(" ")[2]))


def note(line: str) -> str:
    """A line of plain text."""
    return f'<div style="padding:4px 12px 8px;font-size:13px;color:#495057">{html.escape(line)}</div>'
