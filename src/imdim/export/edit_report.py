"""What an edit did to the solid: what it was and is by kind and by size, and a picture of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from manifold3d import Manifold
from PIL import Image

from imdim.export.preview import side_by_side
from imdim.geometry.census import SolidCensus, census_of
from imdim.geometry.solid import to_trimesh
from imdim.target.target import target_from

PIXELS = 360  # of each picture, square
SPECK = 1e-6  # of the volume, a hundredth of the size each way: nobody sees whether a smaller piece or void comes or goes
_KINDS = (("body", "bodies"), ("through-hole", "through-holes"), ("void", "voids"))


@dataclass(frozen=True)
class EditReport:
    """The solids `before` and `after` an edit."""

    before: SolidCensus
    after: SolidCensus
    lost_edges: tuple[str, ...] = ()

    @staticmethod
    def of(before: Manifold, after: Manifold, lost_edges: Sequence[str] = ()) -> EditReport:
        """`lost_edges` say of which edge features edges are gone."""
        return EditReport(census_of(before, SPECK), census_of(after, SPECK), tuple(lost_edges))

    @property
    def changes_in_kind(self) -> str:
        """One line without an end, "4 through-holes became 3"; empty where the solid is of the kind that it was."""
        pairs = zip(self.before.kind, self.after.kind, _KINDS, strict=True)
        return ", ".join([*(f"{_count(old, words)} became {new}" for old, new, words in pairs if old != new), *self.lost_edges])

    def lines(self) -> list[str]:
        """What a person wants to know of the edit, to be read on a terminal."""
        before, after = self.before, self.after
        kind = self.changes_in_kind
        share = round(after.volume / before.volume - 1, 3)
        change = f"{share:+.1%}" if share else "0.0%"
        same = ", ".join(_count(n, words) for n, words in zip(after.kind, _KINDS, strict=True) if n)
        return [
            f"size    {_size(before)} -> {_size(after)}" if _size(before) != _size(after) else f"size    {_size(after)}, as before",
            f"volume  {before.volume:.6g} -> {after.volume:.6g} ({change})",
            f"changed in kind: {kind}" if kind else f"in kind as before: {same}",
        ]


def picture_of(before: Manifold, after: Manifold, pixels: int = PIXELS) -> Image.Image:
    """Both solids by one camera, each `pixels` square, the one before on the left."""
    left, right = side_by_side(target_from(to_trimesh(before)), to_trimesh(after), pixels)
    sheet = Image.new("RGB", (2 * pixels, pixels), "white")
    sheet.paste(left, (0, 0))
    sheet.paste(right, (pixels, 0))
    return sheet


def _count(number: int, words: tuple[str, str]) -> str:
    return f"{number} {words[number != 1]}"


def _size(solid: SolidCensus) -> str:
    return " x ".join(f"{s:.6g}" for s in solid.size)
