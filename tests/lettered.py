"""Text as plain strokes, to be put on planted parts: a font of rectangles, no file is needed."""

from __future__ import annotations

from manifold3d import CrossSection, Manifold, OpType

STROKE = 1.5
HIGH, WIDE = 10.0, 6.0
PITCH = 8.0
TOP, MIDDLE, LOW = HIGH - STROKE, (HIGH - STROKE) / 2, 0.0
RIGHT = WIDE - STROKE
FONT = {  # x, y, width, height of strokes
    "C": ((0, 0, STROKE, HIGH), (0, LOW, WIDE, STROKE), (0, TOP, WIDE, STROKE)),
    "E": ((0, 0, STROKE, HIGH), (0, LOW, WIDE, STROKE), (0, MIDDLE, 5, STROKE), (0, TOP, WIDE, STROKE)),
    "F": ((0, 0, STROKE, HIGH), (0, MIDDLE, 5, STROKE), (0, TOP, WIDE, STROKE)),
    "H": ((0, 0, STROKE, HIGH), (RIGHT, 0, STROKE, HIGH), (0, MIDDLE, WIDE, STROKE)),
    "L": ((0, 0, STROKE, HIGH), (0, LOW, WIDE, STROKE)),
    "O": ((0, 0, STROKE, HIGH), (RIGHT, 0, STROKE, HIGH), (0, LOW, WIDE, STROKE), (0, TOP, WIDE, STROKE)),
    "P": ((0, 0, STROKE, HIGH), (RIGHT, MIDDLE, STROKE, HIGH / 2), (0, MIDDLE, WIDE, STROKE), (0, TOP, WIDE, STROKE)),
    "T": ((RIGHT / 2, 0, STROKE, HIGH), (0, TOP, WIDE, STROKE)),
    "U": ((0, 0, STROKE, HIGH), (RIGHT, 0, STROKE, HIGH), (0, LOW, WIDE, STROKE)),
    "i": ((RIGHT / 2, 0, STROKE, 0.6 * HIGH), (RIGHT / 2, 0.8 * HIGH, STROKE, STROKE)),
    ".": ((RIGHT / 2, 0, STROKE, STROKE),),
    "-": ((1, MIDDLE, WIDE - 2, STROKE),),
    " ": (),
}


def draw_text(text: str, size: float = HIGH) -> CrossSection:
    """Text about the origin, with capitals so high."""
    strokes = [
        CrossSection.square((w, h)).translate((x + PITCH * place, y)) for place, letter in enumerate(text) for x, y, w, h in FONT[letter]
    ]
    drawn = CrossSection.batch_boolean(strokes, OpType.Add)
    return drawn.translate((-(PITCH * len(text) - PITCH + WIDE) / 2, -HIGH / 2)).scale((size / HIGH, size / HIGH))


def box(x: float, y: float, low: float, high: float) -> Manifold:
    """A box about the z axis."""
    return Manifold.cube((x, y, high - low)).translate((-x / 2, -y / 2, low))


def raise_on(body: Manifold, section: CrossSection, level: float, depth: float) -> Manifold:
    """The body with a section raised from its face at a level."""
    return body + section.extrude(depth + 0.5).translate((0, 0, level - 0.5))


def sink_into(body: Manifold, section: CrossSection, level: float, depth: float) -> Manifold:
    """The body with a section sunk into its face at a level."""
    return body - section.extrude(depth + 0.5).translate((0, 0, level - depth))
