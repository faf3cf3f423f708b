"""A contact sheet of a benchmark's parts: the target, the result, and the outline with most curves as a sketch with its overall size.

    python scripts/bench/outline_sheet.py RESULTS --parts FOLDER --out sheet.png

RESULTS is the folder that `benchmark.py` wrote, FOLDER the one that it read. A part without a result, and one without outlines, has a tile
that says so. Exit status 2: a folder is no such folder.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmark import find_parts
from benchmark_table import lay_out
from PIL import Image, ImageDraw, ImageFont

from imdim.app.batch.folder import Part
from imdim.export.preview import FAINT, INK, RESULT_COLOUR, SUPERSAMPLE, side_by_side, thumbnail
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program import codec
from imdim.program.cost import count, curves_of
from imdim.program.outline import Outline, flatten_loop, regions
from imdim.program.tree import Primitive, Program, leaves
from imdim.target.target import load_target

SIDE, COLUMNS = 240, 2  # pixels of one picture, and tiles of three pictures beside each other
MARGIN, FOOTER = 14, 26  # pixels about a sketch, and for its size below it
SEGMENTS = 96
FILL, NO_RESULT = (208, 235, 255), "no result"


def main(argv: Sequence[str]) -> int:
    """Write the sheet; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("--parts", type=Path, required=True, help="the folder of the parts themselves")
    parser.add_argument("--out", type=Path, required=True, help="the picture to write")
    args = parser.parse_args(argv)
    try:
        tiles = [draw_part(part, args.results / part.name) for part in _parts(args.parts, args.results)]
        lay_out(tiles, 3 * SIDE, min(COLUMNS, len(tiles))).save(args.out)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"outline_sheet: {error}\n")
        return 2
    print(f"{args.out}: {len(tiles)} part{'' if len(tiles) == 1 else 's'}")
    return 0


def _parts(source: Path, results: Path) -> list[Part]:
    """The parts that were benchmarked, those that failed among them. Raises ValueError where none was."""
    found = [part for part in find_parts(source, set(), set()) if (results / part.name).is_dir()]
    if not found:
        raise ValueError(f"{results}: no part of {source} has results there")
    return found


def draw_part(part: Part, folder: Path) -> tuple[str, Image.Image]:
    """A title and the three pictures of a part, whose results are in `folder`. Raises InputError for a part that cannot be read."""
    target = load_target(part.source)
    try:
        program = codec.loads((folder / "program.json").read_bytes())
    except FileNotFoundError:
        alone = _say(NO_RESULT) if target.mesh is None else thumbnail(target.mesh, SIDE)
        return f"{part.name}: {NO_RESULT}", _join([alone, _say(NO_RESULT), _say("")])
    pair = side_by_side(target, to_trimesh(to_manifold(program, SEGMENTS)), SIDE)
    leaf = find_richest(program)
    sketch = _say("no outlines") if leaf is None else draw_sketch(leaf, SIDE)
    return f"{part.name}: {count(program)}", _join([*pair, sketch])


def find_richest(program: Program) -> Primitive | None:
    """The first of the leaves whose outlines have most curves; None where there is no outline."""
    drawn = [leaf for leaf in leaves(program) if leaf.outline is not None]
    return max(drawn, key=curves_of, default=None)


def draw_sketch(leaf: Primitive, side: int) -> Image.Image:
    """The outline of an outlined leaf, square, above its curves and its overall size in model units."""
    assert leaf.outline is not None
    picture = _sketch(leaf.outline, SUPERSAMPLE * side, SUPERSAMPLE).resize((side, side), Image.Resampling.BOX)
    (left, low), (right, high) = leaf.outline.bounds
    text = f"{leaf.kind}, {curves_of(leaf)} curves, {right - left:.4g} x {high - low:.4g}"
    ImageDraw.Draw(picture).text((side / 2, side - FOOTER / 2), text, font=ImageFont.load_default(12), fill=INK, anchor="mm")
    return picture


def _sketch(outline: Outline, pixels: int, pen: int) -> Image.Image:
    (left, low), (right, high) = outline.bounds
    scale = (pixels - pen * (2 * MARGIN + FOOTER)) / max(right - left, high - low)
    across, up = pixels / 2, (pixels - pen * FOOTER) / 2
    image = Image.new("RGB", (pixels, pixels), "white")
    draw, ink = ImageDraw.Draw(image), tuple(int(c) for c in 0.6 * RESULT_COLOUR)
    # the largest area first, so that an island lies on the hole around it
    for outer, *holes in regions(outline):
        for loop, fill in ((outer, FILL), *((hole, "white") for hole in holes)):
            corners = [
                ((x - (left + right) / 2) * scale + across, up - (y - (low + high) / 2) * scale) for x, y in flatten_loop(loop, SEGMENTS)
            ]
            draw.polygon(corners, fill=fill)
            draw.line([*corners, corners[0]], fill=ink, width=pen)
    return image


def _say(text: str) -> Image.Image:
    """A blank picture with a line of text."""
    image = Image.new("RGB", (SIDE, SIDE), "white")
    ImageDraw.Draw(image).text((SIDE / 2, SIDE / 2), text, font=ImageFont.load_default(14), fill=FAINT, anchor="mm")
    return image


def _join(pictures: Sequence[Image.Image]) -> Image.Image:
    """Square pictures in a row."""
    row = Image.new("RGB", (SIDE * len(pictures), SIDE), "white")
    for i, picture in enumerate(pictures):
        row.paste(picture, (i * SIDE, 0))
    return row


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
