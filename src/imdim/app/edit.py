"""``imdim edit program.json --set name=value -o folder``: a delivered program with named numbers changed, all that follows with them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Collection, Mapping, Sequence
from functools import reduce
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from imdim.app.export import find_document, list_files, read_texts, refusing
from imdim.export.step_limit import STEP_LIMIT_S
from imdim.reconstruction.config import ConfigError, one_line

if TYPE_CHECKING:
    from imdim.export.delivered import Delivered


def parser() -> argparse.ArgumentParser:
    """The arguments of the command."""
    about = "Change named numbers of a delivered program; what depends on them follows."
    out = argparse.ArgumentParser(prog="imdim edit", description=about)
    out.add_argument("input", help="a results folder, or its program.json; the texts beside it have the names")
    out.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a name and its new value; may be repeated")
    untie = "give each size that shares the name a name of its own, or those of some primitives one; may be repeated, --set comes after"
    out.add_argument("--untie", action="append", default=[], metavar="NAME[=PRIMITIVE,...]", help=untie)
    out.add_argument("--list", action="store_true", help="print the names, their values, what they mean, what they tie, and the holes")
    out.add_argument("-o", "--output", metavar="FOLDER", help="where the edited files go")
    out.add_argument("--strict", action="store_true", help="refuse an edit that opens, closes or parts something")
    out.add_argument("--step", action="store_true", help="write program.step too, which takes seconds")
    return out


def main(argv: Sequence[str]) -> int:
    """The exit status 0; raises ConfigError for a file, a name, a value or a folder that cannot be used."""
    given = parser().parse_args(argv)
    source, folder = find_document(Path(given.input)), given.output
    if given.list:
        sys.stdout.write(list_names(source, _primitives(given.untie)))
    elif not (given.set or given.untie) or folder is None:
        raise ConfigError("imdim edit needs --set NAME=VALUE or --untie NAME, and -o FOLDER, or --list")
    else:
        values, apart = _assignments(given.set), _primitives(given.untie)
        sys.stdout.write(edit_program(source, values, Path(folder), given.step, given.strict, apart))
    return 0


def list_names(source: Path, apart: Mapping[str, Collection[int] | None] = MappingProxyType({})) -> str:
    """The table of names as they are once those in `apart` are untied, those that several primitives share, and the holes that their
    numbers make. Raises ConfigError."""
    from imdim.export.delivered import meanings
    from imdim.export.feature_names import say_features
    from imdim.export.hole_names import hole_groups
    from imdim.export.untie import list_ties

    with refusing(source):
        delivered = _untie_all(open_results(source), apart)
    values = {**delivered.values, **delivered.counts}
    rows = [(name, f"{values[name]:.9g}", meaning) for name, meaning in meanings(delivered).items()]
    names, values = (max((len(row[i]) for row in rows), default=0) for i in (0, 1))
    table = "".join(f"{name:<{names}}  {value:>{values}}  {meaning}\n" for name, value, meaning in rows) or f"{source}: no names\n"
    groups = "".join(f"{group} ({say_features(group.leaves, delivered.labels)})\n" for group in hole_groups(delivered.program))
    ties = "".join(f"{name} of {say_features((i for i, _ in of), delivered.labels)}\n" for name, of in list_ties(delivered).items())
    return table + (f"\nties (--untie NAME)\n{ties}" if ties else "") + (f"\nholes\n{groups}" if groups else "")


def edit_program(
    source: Path,
    values: dict[str, float],
    folder: Path,
    step: bool = False,
    strict: bool = False,
    apart: Mapping[str, Collection[int] | None] = MappingProxyType({}),
) -> str:
    """Write the edited files, and say what was written and what the edit did to the solid. Names in `apart` are untied first (`untie`).

    Raises ConfigError, and then nothing was written; where `strict` also for a solid with other bodies, through-holes or voids.
    """
    from imdim.export.edit import change_values, lost_edges, restate, solid_of, write
    from imdim.export.edit_report import EditReport
    from imdim.export.untie import new_names

    if folder.resolve() == source.resolve().parent:
        raise ConfigError(f"output folder {folder} is that of {source.name}, whose report would be lost: give another")
    with refusing(source):
        before = open_results(source)
        untied = _untie_all(before, apart)
        after = change_values(untied, values)
        start = restate(before)
        solids = solid_of(start), solid_of(after)
        report = EditReport.of(*solids, lost_edges(start, after))
        if strict and report.changes_in_kind:
            raise ValueError(f"{', '.join(f'{n} = {v:g}' for n, v in values.items())}: {report.changes_in_kind}")
        files = write(after, folder, STEP_LIMIT_S if step else 0.0, solids)
    renamed = [f"{old} is now {_spell(names, untied.labels)}" for old, names in new_names(before, untied).items()] if apart else []
    return list_files(folder, files) + "".join(f"{line}\n" for line in [*renamed, *report.lines()])


def _untie_all(delivered: Delivered, apart: Mapping[str, Collection[int] | None]) -> Delivered:
    from imdim.export.untie import untie

    return reduce(lambda one, tie: untie(one, *tie), apart.items(), delivered)


def _spell(names: Mapping[str, Sequence[int]], label: Sequence[str]) -> str:
    from imdim.export.feature_names import say_features

    return ", ".join(f"{name} ({say_features(of, label)})" for name, of in names.items())


def open_results(source: Path) -> Delivered:
    """The program in `source`, a program.json, with the texts beside it. Raises ConfigError."""
    from imdim.export.edit import open_delivered
    from imdim.program import codec

    with refusing(source):
        return open_delivered(codec.parse(source.read_bytes()), read_texts(source))


def _assignments(given: Sequence[str]) -> dict[str, float]:
    out: dict[str, float] = {}
    for text in given:
        name, equals, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = None
        if not equals or number is None:
            raise ConfigError(f"--set {one_line(text)}: expected NAME=NUMBER")
        if name in out:
            raise ConfigError(f"--set {one_line(text)}: {one_line(name)} is given twice")
        out[name] = number
    return out


def _primitives(given: Sequence[str]) -> dict[str, list[int] | None]:
    """For each name the primitives that are to have another one; None where each is to have its own."""
    out: dict[str, list[int] | None] = {}
    for text in given:
        name, equals, numbers = text.partition("=")
        if equals and not all(n.isdecimal() and len(n) < 10 for n in numbers.split(",")):
            raise ConfigError(f"--untie {one_line(text)}: expected NAME or NAME=PRIMITIVE,...")
        if name in out:
            raise ConfigError(f"--untie {one_line(text)}: {one_line(name)} is given twice")
        out[name] = [int(n) for n in numbers.split(",")] if equals else None
    return out
