"""The README's first picture: a part, lines of the program found for it, and the part with one number changed.

    python scripts/make_edit_picture.py part.stl RESULTS NAME=VALUE --out docs/real-part.png

RESULTS is the folder that `imdim fit part.stl -o RESULTS` wrote. Exit status 2: a file, a name or a value that cannot be used.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from imdim.export.delivered import TEXTS
from imdim.export.edit import change_values, open_delivered, solid_of
from imdim.export.preview import FAINT, INK, side_by_side
from imdim.geometry.solid import to_trimesh
from imdim.program.codec import parse
from imdim.target.target import load_target

SIDE, HEADER, TEXT_WIDTH = 420, 40, 470  # pixels
LINE, MOST_LINES, MOST_LETTERS = 27, 12, 52
CHANGED = (196, 60, 28)
_DRAWS = re.compile(r"(linear_extrude|rotate_extrude|cylinder|cube|sphere)\(")
_PLACE = re.compile(r"^\s*(translate|rotate)\(\[[^\]]*\]\)\s*")


def main(argv: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("change", metavar="NAME=VALUE")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args(argv)
    name, _, value = given.change.partition("=")
    try:
        texts = {file: (given.results / file).read_text() for file in TEXTS if (given.results / file).is_file()}
        found = open_delivered(parse((given.results / "program.json").read_bytes()), texts)
        edited = change_values(found, {name: float(value)})
        target = load_target(given.part)
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    left, _ = side_by_side(target, to_trimesh(solid_of(found)), SIDE)
    right, _ = side_by_side(target, to_trimesh(solid_of(edited)), SIDE)[::-1]
    text = _write(_lines(found.texts["program.scad"], name), name)
    sheet = Image.new("RGB", (2 * SIDE + TEXT_WIDTH, SIDE + HEADER), "white")
    headings = (given.part.name, "its program", f"{name} = {float(value):g}")
    at = (0, SIDE, SIDE + TEXT_WIDTH)
    for x, picture, heading, ink in zip(at, (left, text, right), headings, (INK, INK, CHANGED), strict=True):
        sheet.paste(picture, (x, HEADER))
        ImageDraw.Draw(sheet).text((x + 14, 14), heading, font=ImageFont.load_default(19), fill=ink)
    sheet.save(given.out)
    return 0


def _lines(text: str, name: str) -> list[str]:
    """Names and features, the changed name among them; what is left out is three dots."""
    lines = text.replace(", center = true", "").splitlines()
    values = [line.partition(" //")[0] for line in lines if re.match(r"[a-z]\w* = ", line)]
    drawn = [
        _PLACE.sub("", _PLACE.sub("", line)).strip()
        for line in lines
        if _DRAWS.search(line) and not line.startswith(("module", "function", "//"))
    ]
    room = MOST_LINES - len(drawn) - 1
    shown = [line for line in values if line.startswith(f"{name} = ")]
    shown = [line for line in values if line in shown or values.index(line) < room - len(shown)]
    return [*shown[:room], "...", *drawn][:MOST_LINES]


def _write(lines: Sequence[str], name: str) -> Image.Image:
    image = Image.new("RGB", (TEXT_WIDTH, SIDE), "white")
    draw = ImageDraw.Draw(image)
    for number, line in enumerate(lines):
        said = line if len(line) <= MOST_LETTERS else line[: MOST_LETTERS - 3] + "..."
        ink = CHANGED if line.startswith(f"{name} = ") else FAINT if line == "..." else INK
        draw.text((14, 20 + number * LINE), said, font=ImageFont.load_default(16), fill=ink)
    return image


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
