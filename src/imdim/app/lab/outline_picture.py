"""An outline as a picture with what one would measure on a drawing: overall size, number of curves, radii of arcs."""

from __future__ import annotations

from imdim.export.html_tree import svg_path
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, arc_radii
from imdim.program.tree import Primitive

SIDE = 180.0  # of the picture, in pixels
MARGIN = 6.0
MOST_RADII = 8  # that are written out
SAME = 1e-6  # of the overall size, by which equal radii differ
_TEXT = 'style="padding:0 12px 8px;font-size:12px;line-height:1.35;color:#343a40"'


def draw_outline(part: Primitive, unit: str) -> str:
    """HTML of the outline of an extruded or turned primitive; nothing for others."""
    if part.outline is None:
        return ""
    (left, low), (right, high) = part.outline.bounds
    width, height = right - left, high - low
    scale = SIDE / max(width, height)
    w, h = width * scale + 2 * MARGIN, height * scale + 2 * MARGIN
    # y of a picture runs downwards
    turned = f"matrix({scale:.6g} 0 0 {-scale:.6g} {MARGIN - left * scale:.3f} {MARGIN + high * scale:.3f})"
    picture = (
        f'<svg role="img" aria-label="outline" width="{w:.0f}" height="{h:.0f}" viewBox="0 0 {w:.2f} {h:.2f}" style="display:block">'
        f'<path d="{svg_path(part.outline)}" transform="{turned}" vector-effect="non-scaling-stroke" '
        'fill="#d0ebff" fill-rule="evenodd" stroke="#1864ab" stroke-width="1.2"/></svg>'
    )
    return f"<div {_TEXT}>{picture}{_describe(part, part.outline, width, height, unit)}</div>"


def _describe(part: Primitive, outline: Outline, width: float, height: float, unit: str) -> str:
    lines = [f"{_length(width, unit)} × {_length(height, unit)}, {outline.curve_count} curves"]
    if part.kind == "drafted":
        lines.append(f"at the foot; walls lean inward by {part.size[1]:.4g}°")
    radii: list[float] = []
    for radius in sorted(arc_radii(outline)):
        if not radii or radius - radii[-1] > SAME * max(width, height):
            radii.append(radius)
    if radii:
        more = f" and {len(radii) - MOST_RADII} more" if len(radii) > MOST_RADII else ""
        lines.append(f"radii {', '.join(_length(r, unit) for r in radii[:MOST_RADII])}{more}")
    found = [f"{_length(2 * e.rx, unit)} × {_length(2 * e.ry, unit)}" for e in outline.loops if isinstance(e, Ellipse)]
    if found:
        more = f" and {len(found) - MOST_RADII} more" if len(found) > MOST_RADII else ""
        lines.append(f"ellipses {', '.join(found[:MOST_RADII])}{more}")
    return "<br>".join(lines)


def _length(value: float, unit: str) -> str:
    return f"{value:.5g}" + (f"&nbsp;{unit}" if unit else "")
