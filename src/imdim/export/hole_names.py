"""Holes in the texts: what the primitives that make them are called, and what is said above the first of each group.

A hole that is a counterbore and a bore is two cylinders in a program. The comment says what they are together; the names tell them apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from imdim.geometry.holes import find_holes
from imdim.program.hole_codec import HoleFeature
from imdim.program.hole_groups import HoleGroup, group_holes
from imdim.program.holes import Hole, HoleSection
from imdim.program.metric import screw_of
from imdim.program.repeats import Folded, instances
from imdim.program.roles import roles_of, signs
from imdim.program.tree import Program, leaves

SAME = 1e-4  # of a diameter, within which it is that of a hole
_SEATS = ("counterbore", "countersink", "drill_point", "hex_pocket", "bore_chamfer")


def hole_groups(program: Program) -> tuple[HoleGroup, ...]:
    """The holes of a program in groups."""
    return group_holes(find_holes(program))


def hole_features(program: Program) -> tuple[HoleFeature, ...]:
    """The holes of a program, as its document has them."""
    return tuple(HoleFeature.of_group(group) for group in hole_groups(program))


def hole_roles(program: Program) -> list[str]:
    """As `roles_of`, but cuts that make holes and nothing else are called after what they are of them."""
    roles = roles_of(program)
    sign, parts = signs(program), list(leaves(program))
    walls: dict[int, set[str]] = {}
    number: dict[int, int] = {}
    for hole in find_holes(program):
        for section in hole.sections:
            for leaf in section.leaves:
                walls.setdefault(leaf, set()).add(_role(hole, section))
                number[leaf] = number.get(leaf, 0) + 1
    for leaf, words in walls.items():
        outline = parts[leaf].outline
        is_all = outline is None or parts[leaf].kind == "revolve" or number[leaf] >= len(outline.loops)
        bores = sorted(w for w in words if "hole" in w)
        if sign[leaf] < 0 and is_all and (len(words) == 1 or len(bores) == 1):
            roles[leaf] = bores[0] if bores else next(iter(words))
    return roles


def screw_word(hole: Hole) -> str:
    """What the bore of a hole is called: "m3_hole", "m4_tap_hole", "hole"."""
    screw = screw_of(hole)
    if screw is None:
        return "hole"
    return f"{screw.size.lower().replace('.', '_')}{'_tap' if screw.use == 'tap drill' else ''}_hole"


@dataclass(frozen=True)
class BoreWords:
    """What the diameters of holes are called; `known` has those that each primitive makes, with a word."""

    known: Mapping[int, Sequence[tuple[float, str]]]

    @staticmethod
    def of(program: Program) -> BoreWords:
        known: dict[int, list[tuple[float, str]]] = {}
        for hole in find_holes(program):
            for section in (s for s in hole.sections if s is not hole.point_section):
                for leaf in section.leaves:
                    known.setdefault(leaf, []).append((section.diameter, _role(hole, section)))
        return BoreWords(known)

    def word(self, leaf: int, word: str, value: float, label: str) -> str:
        """The word of a number of an outline: "m3_hole_diameter" for "hole_diameter"; without what the label says already."""
        own = label.rstrip("0123456789")
        is_hole = own.endswith(("hole", "bore", *_SEATS))
        if word not in ("hole_diameter", "diameter"):
            return word.removeprefix("hole_") if is_hole else word
        of = min((w for diameter, w in self.known.get(leaf, ()) if abs(diameter - value) <= SAME * value), default="")
        of = of or word.removesuffix("diameter").rstrip("_")
        return f"{of}_diameter" if of and not (is_hole and (of == own or of.endswith("hole"))) else "diameter"


def _role(hole: Hole, section: HoleSection) -> str:
    if section is hole.point_section:
        return "drill_point"
    if section is hole.head and section.corners:
        return "hex_pocket"
    if section is hole.head:
        return hole.kind
    if hole.is_chamfer(section):
        return "bore_chamfer"
    return screw_word(hole)


def hole_notes(program: Program, folded: Folded | None = None) -> dict[int, tuple[str, ...]]:
    """A line for each group of holes, above the first primitive that makes one; of copies above what they are copies of."""
    sources = None if folded is None else [source for source, _ in instances(folded)]
    notes: dict[int, tuple[str, ...]] = {}
    for group in hole_groups(program):
        first = min(leaf if sources is None else sources[leaf] for leaf in group.leaves)
        notes[first] = (*notes.get(first, ()), str(group))
    return notes
