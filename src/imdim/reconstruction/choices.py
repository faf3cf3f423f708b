"""The front of programs from crude to exact: of one body, of the union of several, and the few that a user is shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from imdim.program.cost import count
from imdim.program.front import Choice
from imdim.program.tree import Program, combine_all
from imdim.reconstruction.evidence import ScoringSamples
from imdim.search.front.front import Individual, eliminate_backwards, spread
from imdim.target.target import Frame

MOST_CHOICES = 7
NEGLIGIBLE = 1e-5  # of the volume; a choice that betters the one before by less is none


def choices(evidence: ScoringSamples, programs: Sequence[Program]) -> list[Choice]:
    """The front of `programs` and of what thinning the last one leads through; the last one is among them, alone of its size."""
    score = evidence.scorer.score([programs[-1]])[0]
    final = Individual(programs[-1], score, "final")
    others = [i for i in eliminate_backwards(programs, evidence.scorer) if i.score.primitives != score.primitives]
    out: list[Individual] = []
    for i in sorted([*others, final], key=lambda i: i.score.primitives):
        if i is final or not out or i.score.error < out[-1].score.error - NEGLIGIBLE:
            out.append(i)
    return [Choice(i.program, i.score.volume) for i in out]


def choices_beside(last: Program, unit: Program, others: Sequence[Program], evidence: ScoringSamples, frame: Frame) -> list[Choice]:
    """The front, in the body's units, of `others` and of a `last` program, which stays as it is; `others` and `unit`, the last one
    again, are in the unit frame."""
    return [replace(c, program=last if c.program is unit else frame.undo(c.program)) for c in choices(evidence, [*others, unit])]


def unite_fronts(fronts: Sequence[Sequence[Choice]], finals: Sequence[Program], volumes: Sequence[float]) -> list[Choice]:
    """Fronts of several bodies as one of their union, which leads from the crudest through the finals to the most exact.

    Each step refines the body that gains most volume per primitive. Errors add up by the bodies' `volumes`.
    """
    at = [0] * len(fronts)
    stops = [next(i for i, c in enumerate(front) if c.program == final) for front, final in zip(fronts, finals, strict=True)]
    out = [_union(fronts, at, volumes)]
    for limits in (stops, [len(f) - 1 for f in fronts]):
        while steps_left := [b for b in range(len(fronts)) if at[b] < limits[b]]:
            chosen = max(steps_left, key=lambda b: _rate(fronts[b][at[b]], fronts[b][at[b] + 1], volumes[b]))
            at[chosen] += 1
            out.append(_union(fronts, at, volumes))
    return out


def _union(fronts: Sequence[Sequence[Choice]], at: Sequence[int], volumes: Sequence[float]) -> Choice:
    picked = [front[i] for front, i in zip(fronts, at, strict=True)]
    error = sum((c.error or 0.0) * v for c, v in zip(picked, volumes, strict=True)) / sum(volumes)
    return Choice(combine_all("union", [c.program for c in picked]), error)


def _rate(before: Choice, after: Choice, volume: float) -> float:
    more = count(after.program).primitives - count(before.program).primitives
    return ((before.error or 0.0) - (after.error or 0.0)) * volume / max(more, 1)


def thin_front(front: Sequence[Choice], final: Program, most: int = MOST_CHOICES) -> list[Choice]:
    """At most `most` of a front, even in the logarithm of the error; the ends and `final` are among them."""
    final_at = next((i for i, c in enumerate(front) if c.program == final), len(front) - 1)
    return [front[i] for i in spread([c.error or 0.0 for c in front], most, final_at)]
