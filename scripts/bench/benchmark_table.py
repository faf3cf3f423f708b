"""The table of a benchmark: rows as text, shares over all parts, CSV, and all previews in one picture."""

from __future__ import annotations

import csv
import io
import math
import statistics
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING

from benchmark_part import Row

from imdim.whole_file import write_text_whole

if TYPE_CHECKING:
    from PIL import Image

FAILED = "FAILED"
FEW = 12  # features, with which a part is still read at a glance


def write_tables(rows: list[Row], title: str, budget: float, out: Path) -> str:
    """`table.md` and `table.csv`, whole; the text of the first."""
    text = f"# {title}\n\n{markdown(rows)}\n\n" + "\n".join(f"- {s}" for s in summary(rows, budget)) + "\n"
    write_text_whole(out / "table.md", text)
    write_text_whole(out / "table.csv", csv_text(rows))
    return text


def line(row: Row) -> str:
    against = "" if row.reference is None else f" (reference {row.reference})"
    size = f"{row.primitives} primitives{against}" if row.curves is None else f"{row.primitives} features{against}, {row.curves} curves"
    return f"{row.part:<28} IoU {row.iou:.4f}  {size}  {row.seconds:.1f} s  {row.peak_mib:.0f} MiB  {row.stop}"


def markdown(rows: list[Row]) -> str:
    """The table, one row per part; features and curves where curves are counted."""
    sizes = ("features", "curves") if _are_counted(rows) else ("primitives",)
    blended = any(r.edges for r in rows)
    names = ["part", "IoU", "Hausdorff / diagonal", *sizes, *(("edge features", "IoU with these") if blended else ())]
    names += ["reference", "reference IoU", "seconds", "peak MiB", "STEP", "stop"]
    body = [
        (
            *(r.part, f"{r.iou:.4f}", f"{r.hausdorff:.4f}", *map(_or, (r.primitives, r.curves)[: len(sizes)])),
            *((_or(r.edges or None), f"{r.whole_iou:.4f}" if r.edges else "") if blended else ()),
            *(_or(r.reference), _or(r.reference_iou), f"{r.seconds:.1f}", f"{r.peak_mib:.0f}", "yes" if r.step else "no", r.stop),
        )
        for r in rows
    ]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (names, ["---"] * len(names), *body))


def summary(rows: list[Row], budget: float) -> list[str]:
    """Shares over every part, failures counted as misses."""
    count = len(rows)
    known = [r for r in rows if r.reference is not None]
    short = [r for r in known if _primitives(r) <= (r.reference or 0)]
    lines = [f"{count} parts, {sum(r.stop.startswith('FAILED') for r in rows)} failed"]
    lines += [f"IoU >= {bar}: {_share(sum(r.iou >= bar for r in rows), count)}" for bar in (0.99, 0.98, 0.97)]
    if _are_counted(rows):
        few = sum(r.iou >= 0.99 and _primitives(r) <= FEW for r in rows)
        lines.append(f"IoU >= 0.99 with at most {FEW} features: {_share(few, count)}")
        lines += [_with_edges(rows, bar) for bar in (0.995, 0.99)] if any(r.edges for r in rows) else []
        lines.append(f"median features: {statistics.median(map(_primitives, rows)):g}, without copies {_median_distinct(rows)}")
    lines.append(f"without STEP: {sum(not r.step for r in rows)}")
    lines.append(f"mean IoU {statistics.fmean(r.iou for r in rows):.4f}")
    if known:
        lines.append(f"no more primitives than the reference: {_share(len(short), len(known))}")
        lines.append(f"IoU >= 0.99 and no more primitives than the reference: {_share(sum(r.iou >= 0.99 for r in short), len(known))}")
    for most in (math.inf, 30):
        rivals = [r for r in known if r.reference_iou and (r.reference or 0) <= most]
        better = sum(r.iou >= (r.reference_iou or 0) and _primitives(r) < (r.reference or 0) for r in rivals)
        if rivals:
            among = "" if most == math.inf else f", among those of at most {most} reference primitives"
            lines.append(f"IoU at least the reference's and fewer primitives{among}: {_share(better, len(rivals))}")
    times = [r.seconds for r in rows]
    lines.append(
        f"seconds: median {statistics.median(times):.1f}, longest {max(times):.1f}; over the budget: {sum(t > budget for t in times)}"
    )
    lines.append(f"peak memory: {max(r.peak_mib for r in rows):.0f} MiB")
    return lines


def _are_counted(rows: Sequence[Row]) -> bool:
    """Whether anybody has counted the curves of outlines."""
    return any(row.curves is not None for row in rows)


def _primitives(row: Row) -> float:
    return math.inf if row.primitives is None else row.primitives


def _with_edges(rows: Sequence[Row], bar: float) -> str:
    """How many parts are as good with their fillets and chamfers, and how many of these are short."""
    good = [r for r in rows if r.whole_iou >= bar]
    short = sum((math.inf if r.features is None else r.features) + r.edges <= FEW for r in good)
    few = f"with at most {FEW} features, those of edges among them"
    return f"with all edges, IoU >= {bar}: {_share(len(good), len(rows))}, {few}: {_share(short, len(rows))}"


def _median_distinct(rows: Sequence[Row]) -> str:
    """The median of features that are no copies, of the parts that tell."""
    known = [row.distinct for row in rows if row.distinct is not None]
    return f"{statistics.median(known):g}" if known else "not told"


def _share(hits: int, count: int) -> str:
    return f"{hits} of {count} ({100 * hits / count:.0f} %)"


def _or(value: float | int | None) -> str:
    return "" if value is None else str(value)


def csv_text(rows: list[Row]) -> str:
    """One line per part, under the names of the fields."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [f.name for f in fields(Row)])
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    return text.getvalue()


def contact_sheet(pictures: Sequence[Path], out: Path, width: int = 480, columns: int = 3) -> None:
    """All pictures that exist, scaled to `width`, row by row, each under its part's name."""
    from PIL import Image

    tiles = []
    for path in filter(Path.is_file, pictures):
        with Image.open(path) as picture:
            tiles.append((path.parent.name, picture.convert("RGB").resize((width, round(width * picture.height / picture.width)))))
    if tiles:
        lay_out(tiles, width, columns).save(out)


def lay_out(tiles: Sequence[tuple[str, Image.Image]], width: int, columns: int) -> Image.Image:
    """One picture of all `tiles`, one at least, each `width` wide and under its name, row by row."""
    from PIL import Image, ImageDraw

    height = max(tile.height for _, tile in tiles) + 16
    sheet = Image.new("RGB", (width * columns, height * -(-len(tiles) // columns)), "white")
    for i, (name, tile) in enumerate(tiles):
        corner = (i % columns * width, i // columns * height)
        ImageDraw.Draw(sheet).text((corner[0] + 4, corner[1] + 2), name, fill="black")
        sheet.paste(tile, (corner[0], corner[1] + 16))
    return sheet
