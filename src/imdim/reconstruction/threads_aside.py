"""Threads of a target are set aside before the search, which sees the cylinder that carries each, as a drawing shows it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from imdim.detection.facets import facets_of
from imdim.detection.threads import Thread, describe_thread, find_threads
from imdim.detection.unthread import take_off_threads
from imdim.target.target import Target, with_mesh


class Unthreaded(NamedTuple):
    """A target without threads, and a sentence for each of those that it had."""

    target: Target
    notes: tuple[str, ...] = ()


def set_threads_aside(target: Target, unit: float) -> Unthreaded:
    """The target with plain cylinders in place of its threads; a cloud, or a mesh that bounds no solid, as it is. `unit` is the length of
    the target's unit in the units that threads are told in."""
    if target.mesh is None or not target.is_solid:
        return Unthreaded(target)
    facets = facets_of(target.mesh)
    threads = find_threads(facets)
    if not threads:
        return Unthreaded(target)
    plain = take_off_threads(target.mesh, facets, threads)
    notes = tuple(dict.fromkeys(_tell(plain.threads, plain.kept, unit)))
    return Unthreaded(with_mesh(target, plain.mesh) if plain.threads else target, notes)


def _tell(taken: tuple[Thread, ...], kept: tuple[Thread, ...], unit: float) -> Iterator[str]:
    for thread in taken:
        carrier = "minor" if thread.internal else "major"
        yield f"{describe_thread(_scale(thread, unit))}, set aside: the program has the cylinder of its {carrier} diameter"
    for thread in kept:
        yield f"{describe_thread(_scale(thread, unit))}, could not be set aside: it is part of the shape"


def _scale(thread: Thread, unit: float) -> Thread:
    """A thread told in other units."""
    lengths = {name: unit * getattr(thread, name) for name in ("pitch", "lead", "minor", "major")}
    return replace(thread, **lengths)
