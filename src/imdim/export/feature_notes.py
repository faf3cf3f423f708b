"""A line of comment above each feature in the texts: its label and number, what it is cut into, how it repeats, and what holes it makes.

The texts keep the labels that they began with, as they keep the names of numbers, and `read_labels` finds them there.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from imdim.export.feature_names import say_feature, say_numbers
from imdim.export.hole_names import hole_notes
from imdim.export.surroundings import Surroundings
from imdim.geometry.hosts import hosts_of_cuts
from imdim.geometry.lowering import Lowered, lower
from imdim.program.hole_groups import write_size
from imdim.program.repeats import Folded, Repeat, instances, repeats, size
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program, leaves

Notes = Mapping[int, tuple[str, ...]]  # by the number of the primitive above which they stand

_COMMENT = re.compile(r"^(\s*)(//|#) (.*)$")
_LABEL = re.compile(r"^\s*// ([A-Za-z]\w*) #(\d{1,6})(?:(?: to |, )#(\d{1,6}))?(?: and \d+ cop(?:y|ies))?(?:[,:] .*)?$", re.MULTILINE)


def feature_notes(program: Program, label: Sequence[str], folded: Folded | None = None) -> Notes:
    """The comments above the leaves that are written; features of one label that follow each other share one. `label` has that of each
    leaf; without any, the comments say what holes there are and nothing else."""
    holes = hole_notes(program, folded)
    if not label:
        return holes
    sign, parts, solid = signs(program), list(leaves(program)), lower(program)
    served = _hosts_by_label(program, label)
    notes: dict[int, tuple[str, ...]] = {}
    for run in _runs(label, folded):
        own = tuple(line for leaf in run.members for line in holes.get(leaf, ()))
        is_hole = len(own) == 1 and sign[run.first] < 0 and parts[run.first].outline is None
        through = ["through"] if not own and sign[run.first] < 0 and all(_goes_through(solid, parts, leaf) for leaf in run.members) else []
        host = {served[leaf] for leaf in run.members}
        inside = [f"in {host.pop()}"] if len(host) == 1 and served[run.first] else []
        said = ", ".join([run.numbers(label[run.first]), *inside, *([] if is_hole else run.arrangement), *through])
        depth = "" if own or through or sign[run.first] > 0 else _say_depth(solid, parts, run.members)
        notes[run.first] = (f"{said}: {own[0]}",) if is_hole else (f"{said}: {depth}",) if depth else (said, *own)
    return notes


def _hosts_by_label(program: Program, label: Sequence[str]) -> list[str]:
    """For each leaf that cuts the label of what it serves; empty for all others, and where only one label adds: all serve that."""
    added = {name for name, sign in zip(label, signs(program), strict=True) if sign > 0}
    if len(added) < 2:
        return [""] * len(label)
    return ["" if host is None else label[host] for host in hosts_of_cuts(program)]


def _goes_through(solid: Lowered, parts: Sequence[Primitive], leaf: int) -> bool:
    around = Surroundings.of(solid, leaf, parts[leaf])
    return around is not None and around.passes_through()


def _say_depth(solid: Lowered, parts: Sequence[Primitive], members: Sequence[int]) -> str:
    """As "20 x 10, 3 deep" of blind pockets that are alike, "6 wide, 2 deep" of channels; else nothing."""
    said = {_depth(solid, parts[leaf], leaf) for leaf in members}
    return said.pop() if len(said) == 1 else ""


def _depth(solid: Lowered, p: Primitive, leaf: int) -> str:
    around = Surroundings.of(solid, leaf, p) if p.kind in ("box", "extrude") else None
    pocket = None if around is None else around.measure_pocket()
    if around is None or pocket is None:
        return ""
    axis, depth = pocket
    walled = [write_size(size) for a, size in enumerate(p.size) if a != axis and around.has_walls(a)] if p.kind == "box" else []
    return ", ".join([*([f"{' x '.join(walled)}{' wide' if len(walled) == 1 else ''}"] if walled else []), f"{write_size(depth)} deep"])


def read_labels(text: str, program: Program, folded: Folded | None = None) -> tuple[str, ...]:
    """The labels of all leaves as the comments of an OpenSCAD text say them; none where they do not say all."""
    said = {leaf: found[1] for found in _LABEL.finditer(text) for leaf in range(int(found[2]), int(found[3] or found[2]) + 1)}
    sources = _sources(sum(1 for _ in leaves(program)), folded)
    return tuple(said[s] for s in sources) if all(s in said for s in sources) else ()


def write_notes(notes: Notes, leaf: int, mark: str) -> list[str]:
    """The comments above a primitive."""
    return [f"{mark} {line}" for line in notes.get(leaf, ())]


def renew_notes(text: str, before: Notes, after: Notes) -> str:
    """A text whose comments say `after` where they said `before`; those of holes that are no more are left out."""
    waiting: dict[str, deque[tuple[str, ...]]] = {}
    for leaf, lines in before.items():
        now = after.get(leaf, ())
        for i, line in enumerate(lines):  # the last makes room for more
            waiting.setdefault(line, deque()).append(now[i : i + 1] if i < len(lines) - 1 else now[i:])
    out = []
    for line in text.split("\n"):
        found = _COMMENT.match(line)
        if found is None or not waiting.get(found[3]):
            out.append(line)
            continue
        out += [f"{found[1]}{found[2]} {says}" for says in waiting[found[3]].popleft()]
    return "\n".join(out)


@dataclass(frozen=True)
class _Run:
    """Leaves of one label that stand together, or one leaf with all its copies."""

    first: int
    members: tuple[int, ...]
    arrangement: tuple[str, ...] = ()

    def numbers(self, label: str) -> str:
        """The label with the numbers of its leaves."""
        if self.members[-1] - self.first >= len(self.members):
            others = len(self.members) - 1
            return f"{say_feature(label, self.first)} and {others} cop{'y' if others == 1 else 'ies'}"
        return f"{label} {say_numbers(self.members)}"


def _runs(label: Sequence[str], folded: Folded | None) -> Iterator[_Run]:
    """The runs in the order of leaves: as no numbers decide where one begins, an edit keeps them."""
    copies: dict[int, list[int]] = {}
    for leaf, source in enumerate(_sources(len(label), folded)):
        copies.setdefault(source, []).append(leaf)
    how = _arrangements(folded)
    alone: list[int] = []
    for source, members in copies.items():
        joins = bool(alone) and len(members) == 1 and alone[-1] == source - 1 and label[alone[-1]] == label[source]
        if alone and not joins:
            yield _Run(alone[0], tuple(alone))
            alone = []
        if len(members) == 1:
            alone.append(source)
        else:
            yield _Run(source, tuple(members), (how[source],))
    if alone:
        yield _Run(alone[0], tuple(alone))


def _sources(number: int, folded: Folded | None) -> list[int]:
    """For each leaf the one that it is a copy of, itself if of none."""
    return list(range(number)) if folded is None else [source for source, _ in instances(folded)]


def _arrangements(folded: Folded | None) -> dict[int, str]:
    """For each leaf that is written how the innermost repeat places its copies, in words without numbers of length."""
    found: dict[int, str] = {}
    for first, repeat in [] if folded is None else repeats(folded):
        found |= dict.fromkeys(range(first, first + size(repeat.part)), _in_words(repeat))
    return found


def _in_words(repeat: Repeat) -> str:
    if repeat.kind == "grid":
        return f"{' x '.join(map(str, repeat.counts))} grid"
    how = {"linear": "in a row", "circular": "on a circle", "mirror": "mirrored"}
    return f"{repeat.counts[0]} {how[repeat.kind]}"
