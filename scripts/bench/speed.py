"""The kernels that a run spends its time in, against a plain reference and against what this core can do at most, all in the same run.

    OMP_NUM_THREADS=1 python scripts/bench/speed.py [--repeat 10] [--size 1.0] [--only NAME ...] [--json out.json]

Each repetition measures the peaks (`speed_peaks`), then every kernel and its plain reference (`speed_kernels`, `speed_plain`): a core that
is slow for a moment is slow for all three. Figures are medians of the repetitions' ratios; seconds are those of the processor. `allowed` is
the largest share that this mix of instructions could reach: products without a sum to feed fill half of a fused instruction, and roots
have a slower unit of their own. The second table says what each kernel has to do, and how long each unit of the core would need for its
part if it never waited: no kernel can be faster than the longest of these. Exit status 1 where an answer is not that of its reference.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import torch
from speed_kernels import Kernel, Work, kernels
from speed_peaks import Micro, Peaks, seconds


@dataclass(frozen=True)
class Figure:
    """One kernel: seconds of a call and of its reference, `times` faster, shares of the peaks of arithmetic and memory, the share that its
    instructions allow, and by how much the answers differ; its work, and the least `Bounds` of the peaks on that."""

    name: str
    what: str
    seconds: float
    plain_s: float
    times: float
    share: float
    allowed: float
    of_memory: float
    differs: float
    right: bool
    work: Work
    bounds: Bounds


@dataclass(frozen=True)
class Bounds:
    """Seconds that each unit of the core needs for its part of the work at least: instructions, square roots, and memory."""

    ports: float
    roots: float
    memory: float

    @staticmethod
    def of(work: Work, arithmetic: float, roots: float, stream: float) -> Bounds:
        """`arithmetic` in operations per second, two to a fused instruction."""
        ports = max((work.slots + work.roots) / (arithmetic / 2), work.flops / arithmetic)
        return Bounds(ports, work.roots / roots, work.bytes / stream)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=10)
    parser.add_argument("--size", type=float, default=1.0, help="of the work, 1 being that of the published figures")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="the first letters of kernels")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    peaks, figures = measured(args.repeat, args.size, args.only)
    print(f"load average {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores; median of {args.repeat}")
    print(", ".join(f"{name} {value / 1e9:.3g} G/s" for name, value in asdict(peaks).items()))
    print("\n" + table(figures) + "\n\n" + work_table(figures))
    if args.json:
        args.json.write_text(json.dumps({"peaks": asdict(peaks), "kernels": [asdict(f) for f in figures]}, indent=1) + "\n")
    return 0 if all(f.right for f in figures) else 1


def measured(repeat: int, size: float, only: Sequence[str] | None = None) -> tuple[Peaks, list[Figure]]:
    """Medians of `repeat` rounds of peaks and kernels."""
    torch.set_num_threads(1)
    chosen = [k for k in kernels(size) if not only or k.name.startswith(tuple(only))]
    differences = {k.name: k.differs(k.run(k.prepare()), k.plain()) for k in chosen}  # and all is compiled
    micro = Micro()
    rounds: list[tuple[Peaks, dict[str, tuple[float, float]]]] = []
    for _ in range(repeat):
        # a reference that takes seconds is no worse known after three times
        often = len(rounds) < 3 or repeat < 3
        rounds.append((micro.measured(), {k.name: (_timed(k), seconds(k.plain) if often else 0.0) for k in chosen}))
    figures = [_figure(k, [(p, found[k.name]) for p, found in rounds], differences[k.name]) for k in chosen]
    peaks = Peaks(*(statistics.median(column) for column in zip(*(asdict(p).values() for p, _ in rounds), strict=True)))
    return peaks, figures


def _timed(kernel: Kernel) -> float:
    ready = kernel.prepare()
    return seconds(lambda: kernel.run(ready))


def _figure(kernel: Kernel, rounds: list[tuple[Peaks, tuple[float, float]]], differs: float) -> Figure:
    def median(of: Callable[[Peaks, float, float], float]) -> float:
        return statistics.median(of(peaks, *found) for peaks, found in rounds)

    work = kernel.work
    plain = statistics.median(p for _, (_, p) in rounds if p)
    return Figure(
        kernel.name,
        kernel.what,
        median(lambda _, s, __: s),
        plain,
        statistics.median(p / s for _, (s, p) in rounds if p),
        median(lambda peaks, s, _: work.flops / s / _arithmetic(kernel, peaks)),
        median(lambda peaks, _, __: allowed(work, _arithmetic(kernel, peaks), _roots(kernel, peaks))),
        median(lambda peaks, s, _: work.bytes / s / peaks.stream),
        differs,
        differs <= kernel.tolerance,
        work,
        Bounds(*(median(lambda peaks, _, __, unit=unit: getattr(_bounds(kernel, peaks), unit)) for unit in ("ports", "roots", "memory"))),
    )


def _bounds(kernel: Kernel, peaks: Peaks) -> Bounds:
    return Bounds.of(kernel.work, _arithmetic(kernel, peaks), _roots(kernel, peaks), peaks.stream)


def allowed(work: Work, arithmetic: float, roots: float) -> float:
    """The share of `arithmetic` (operations per second, two to a fused instruction) that the mix allows; the unit of roots works beside."""
    bounds = Bounds.of(work, arithmetic, roots, math.inf)
    return work.flops / arithmetic / max(bounds.ports, bounds.roots)


def _arithmetic(kernel: Kernel, peaks: Peaks) -> float:
    return peaks.single if kernel.precision == "single" else peaks.double


def _roots(kernel: Kernel, peaks: Peaks) -> float:
    return peaks.roots_single if kernel.precision == "single" else peaks.roots_double


def table(figures: Sequence[Figure]) -> str:
    head = ("kernel", "ms", "plain ms", "times faster", "share of arithmetic peak", "allowed by its mix", "share of memory peak", "differs")
    rows = [
        (
            f"{f.name} ({f.what})",
            f"{1e3 * f.seconds:.3g}",
            f"{1e3 * f.plain_s:.4g}",
            f"{f.times:.3g}",
            f"{100 * f.share:.3g} %",
            f"{100 * f.allowed:.3g} %",
            f"{100 * f.of_memory:.3g} %",
            f"{f.differs:.1e}" + ("" if f.right else " WRONG"),
        )
        for f in figures
    ]
    return _join(head, rows)


def work_table(figures: Sequence[Figure]) -> str:
    """What each kernel has to do, and the least time of each unit for that."""
    head = ("kernel", "Mflop", "M roots", "MB", "flop per byte", "least ms: ports", "roots", "memory", "taken", "share of the longest")
    rows = [
        (
            f.name,
            f"{f.work.flops / 1e6:.4g}",
            f"{f.work.roots / 1e6:.3g}",
            f"{f.work.bytes / 1e6:.3g}",
            f"{f.work.flops / f.work.bytes:.3g}",
            *(f"{1e3 * bound:.2g}" for bound in (f.bounds.ports, f.bounds.roots, f.bounds.memory)),
            f"{1e3 * f.seconds:.3g}",
            f"{100 * max(f.bounds.ports, f.bounds.roots, f.bounds.memory) / f.seconds:.2g} %",
        )
        for f in figures
    ]
    return _join(head, rows)


def _join(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, ("---",) * len(head), *rows))


if __name__ == "__main__":
    sys.exit(main())
