"""Plots of the page, as SVG: the front of error against size, whose points load their programs, and the curves of a run."""

from __future__ import annotations

import math
from collections.abc import Sequence

from imdim.app.lab.renderers import clickable, note
from imdim.app.lab.state import CurvePoint
from imdim.program.cost import count
from imdim.program.front import Choice
from imdim.program.tree import Program

LEAST = 1e-7  # what a scale of logarithms shows of zero
WIDE, LEFT, RIGHT = 300, 44, 12
HIGH, TITLE = 92, 20  # of one curve, and of its title
INKS = ("#c2255c", "#1864ab", "#2b8a3e")
MARKS = 40  # steps that have a dot each
_LOOK = 'style="width:100%;font:11px sans-serif;fill:#343a40" role="img"'


def front(choices: Sequence[Choice], shown: Program | None) -> str:
    """Error against size; each point loads its program."""
    known = [(i, count(c.program), c.error, c.program == shown) for i, c in enumerate(choices, 1) if c.error is not None]
    if not known:
        return note("Error against size is drawn here when a run has found programs of several sizes.")
    tall, low = 190, 30
    sizes, logs = [k[1].primitives for k in known], [math.log10(max(k[2], 1e-6)) for k in known]
    x0, x1, y0, y1 = min(sizes) - 0.5, max(sizes) + 0.5, math.floor(min(logs) - 0.1), math.ceil(max(logs) + 0.1)

    def x(size: float) -> float:
        return LEFT + (size - x0) / (x1 - x0) * (WIDE - LEFT - RIGHT)

    def y(log: float) -> float:
        return tall - low - (log - y0) / max(y1 - y0, 1) * (tall - low - 12)

    grid = "".join(_rung(y(p), f"1e{p}") for p in range(y0, y1 + 1))
    ticks = "".join(f'<text x="{x(s):.1f}" y="{tall - low + 15}" text-anchor="middle">{s}</text>' for s in sorted(set(sizes)))
    path = " ".join(f"{x(s):.1f},{y(log):.1f}" for s, log in sorted(zip(sizes, logs, strict=True)))
    dots = "".join(
        f'<g data-n="{i}" role="button" tabindex="0" style="cursor:pointer" onkeydown="if(event.key===\'Enter\')this.dispatchEvent('
        f"new MouseEvent('click',{{bubbles:true}}))\"><title>{i}: {counts}, error {error:.3g}</title>"
        f'<circle cx="{x(counts.primitives):.1f}" cy="{y(log):.1f}" r="12" fill="transparent"/>'
        f'<circle cx="{x(counts.primitives):.1f}" cy="{y(log):.1f}" r="6" fill="{"#e67700" if now else "#1864ab"}"/></g>'
        for (i, counts, error, now), log in zip(known, logs, strict=True)
    )
    head = f'<svg viewBox="0 0 {WIDE} {tall}" {_LOOK} aria-label="error against size">'
    says = "primitives (error upwards); click a point to load it"
    foot = f'<text x="{(WIDE + LEFT) / 2}" y="{tall - 2}" text-anchor="middle">{says}</text></svg>'
    return clickable("Choice", f'{head}{grid}{ticks}<polyline points="{path}" fill="none" stroke="#74a5d4"/>{dots}{foot}')


def curves(steps: Sequence[CurvePoint]) -> str:
    """Error, primitives and the largest violation of a constraint over the seconds of a run, one above the other."""
    if not steps:
        return note("Error, size, and how far relations are off are drawn here while a run goes on.")
    seconds, end = [s.seconds for s in steps], max(steps[-1].seconds, 1e-3)
    x = [LEFT + t / end * (WIDE - LEFT - RIGHT) for t in seconds]
    rows = (
        _curve(0, "error", x, [s.error for s in steps], True),
        _curve(1, "primitives", x, [float(s.primitives) for s in steps], False),
        _curve(2, "relations off by", x, [s.violation for s in steps], True),
    )
    low = 3 * HIGH + 13
    foot = f'<text x="{LEFT}" y="{low}">0</text><text x="{WIDE - RIGHT}" y="{low}" text-anchor="end">{end:.3g} s</text>'
    head = f'<svg viewBox="0 0 {WIDE} {low + 5}" {_LOOK} aria-label="curves of the run">'
    return f'<div style="padding:0 12px 8px">{head}{"".join(rows)}{foot}</svg></div>'


def _curve(row: int, name: str, x: Sequence[float], values: Sequence[float], powers: bool) -> str:
    """One curve below its title: a program counts until the next one comes."""
    shown = [math.log10(max(v, LEAST)) for v in values] if powers else list(values)
    low, high = (math.floor(min(shown)), math.floor(max(shown)) + 1) if powers else (0, int(max(shown)) + 1)

    def y(value: float) -> float:
        return HIGH * (row + 1) - 6 - (value - low) / (high - low) * (HIGH - TITLE - 6)

    ups = [y(v) for v in shown]
    line = " ".join(f"{a:.1f},{b:.1f}" for a, b in _stairs(x, ups))
    dots = "".join(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2.5"/>' for a, b in zip(x[-MARKS:], ups[-MARKS:], strict=True))
    grid = "".join(_rung(y(at), f"{'1e' if powers else ''}{at}") for at in (low, high))
    says = "none" if powers and values[-1] <= LEAST else f"{values[-1]:.2g}"
    title = f'<text x="{LEFT}" y="{HIGH * row + 13}" style="font-weight:600">{name}: {says}</text>'
    curve = f'<polyline points="{line}" fill="none" stroke="{INKS[row]}" stroke-width="2"/><g fill="{INKS[row]}">{dots}</g>'
    return f'<g data-curve="{name}">{title}{grid}{curve}</g>'


def _rung(y: float, label: str) -> str:
    """A line across a plot with its value on the left."""
    line = f'<line x1="{LEFT}" x2="{WIDE - RIGHT}" y1="{y:.1f}" y2="{y:.1f}" stroke="#dee2e6"/>'
    return f'{line}<text x="{LEFT - 5}" y="{y + 4:.1f}" text-anchor="end">{label}</text>'


def _stairs(x: Sequence[float], y: Sequence[float]) -> list[tuple[float, float]]:
    """The corners of a line that stays where it is until the next value."""
    return [(x[0], y[0])] + [corner for i in range(1, len(x)) for corner in ((x[i], y[i - 1]), (x[i], y[i]))]
