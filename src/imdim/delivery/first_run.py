"""Before the first fit on a machine its kernels are compiled, outside the budget and with a word about it; later runs load them."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, TextIO

from numba import njit
from numba.core import event

if TYPE_CHECKING:
    from imdim.target.target import Target

KERNELS = 260  # about so many, to say how far it is
SHOWN_EVERY_S = 0.2


@njit(cache=True)
def _first_run_mark(number):  # pragma: no cover - compiled
    """Cached like the others, in a moment: where it has to be compiled, they have to be too."""
    return number + 1


def compile_kernels(stream: TextIO) -> float:
    """Compile what a fit needs unless this machine has it, and say so on `stream`; the seconds that it took."""
    start, before = time.perf_counter(), _misses()
    _first_run_mark(1)
    if _misses() > before:
        with _Counter(stream) as counter:
            _reconstruct_small_part()
        counter.conclude(time.perf_counter() - start)
    return time.perf_counter() - start


def _misses() -> int:
    return sum(_first_run_mark.stats.cache_misses.values())  # type: ignore[attr-defined]


class _Counter(event.Listener):
    """Counts what numba compiles, and tells of it if there is anything: on a terminal in place."""

    def __init__(self, stream: TextIO) -> None:
        self._stream, self._shown, self._count = stream, 0.0, 0

    def __enter__(self) -> _Counter:
        event.register("numba:compile", self)
        return self

    def __exit__(self, *_: object) -> None:
        event.unregister("numba:compile", self)

    def on_start(self, event: Any) -> None:
        if not self._count:
            self._stream.write("imdim: first run on this machine: compiling, before the clock starts (about 40 s of a core)\n")
            self._stream.flush()
            self._count = 1

    def on_end(self, event: Any) -> None:
        self._count += 1
        if self._stream.isatty() and time.perf_counter() > self._shown + SHOWN_EVERY_S:
            self._shown = time.perf_counter()
            self._stream.write(f"\r  {self._count} of about {KERNELS} kernels\r")
            self._stream.flush()

    def conclude(self, seconds: float) -> None:
        """The last word, where there was a first."""
        if self._count:
            self._stream.write(f"imdim: compiled in {seconds:.0f} s, kept for later runs\n")


def _reconstruct_small_part() -> None:
    """From a mesh to scores: a plate with a slot, a hole and a rounded end, which takes outlines, cutters and round faces."""
    from imdim.delivery.evaluate import evaluate
    from imdim.geometry.solid import to_manifold, to_trimesh
    from imdim.geometry.winding import winding_number
    from imdim.reconstruction.config import Settings
    from imdim.reconstruction.pipeline import reconstruct_best

    target = _small_part()
    for language in ("cad", "csg"):
        found = reconstruct_best(target, Settings(budget_s=600.0, language=language))
        evaluate(found.program, target, samples=100)
    winding_number(to_trimesh(to_manifold(found.program)), target.points[:1])


def _small_part() -> Target:
    from imdim.geometry.solid import to_manifold, to_trimesh
    from imdim.program.outline import Outline, circle
    from imdim.program.tree import Combine, Primitive
    from imdim.target.target import target_from

    plate = ((-8.0, -3.0, 0.0), (8.0, -3.0, 1.0), (8.0, 3.0, 0.0), (-8.0, 3.0, 0.0))  # x, y, bulge: 1 is half a circle
    link = Primitive("extrude", (4.0,), outline=Outline((plate, circle(1.0, 8.0))))
    pocket = Primitive("box", (4.0, 3.0, 2.0), center=(-4.0, 0.0, 1.5))
    return target_from(to_trimesh(to_manifold(Combine("difference", link, pocket))), "first run")
