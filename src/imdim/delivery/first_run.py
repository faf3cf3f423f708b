"""Before the first fit on a machine its kernels are compiled, outside the budget and with a word about it; later runs load them.

Those that clouds alone need wait for the first cloud: a mesh is not kept waiting for them.

What builds a wheel for its own machine compiles them into it (`compiled_build.py` of the source), and there is no first run.
Where there is a second core another process compiles those that say what a program is worth, while this one compiles those that look for
programs, and comes to the others when they are done; of a cloud's, those that search while this one compiles those that detect. They meet
in numba's cache, in which files appear whole.

Kernels copy arrays number by number: for one that is set as a whole numba compiles a message about shapes that do not fit, with all that
makes text of numbers, for a second and a half.
"""

from __future__ import annotations

import gc
import pickle
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO

from numba import njit
from numba.core import event

from imdim.side_process import count_cores, without_copies

try:
    import resource
except ImportError:  # where there are no such limits
    resource = None

if TYPE_CHECKING:
    import numpy as np
    from trimesh import Trimesh

    from imdim.program.tree import Combine
    from imdim.target.target import Target

KERNEL = "@njit"  # in the text of a module that has some
FEW_POINTS, BLUR = 200, 0.15  # of a small cloud, and how far they lie off its part
# looks at the clock by which a search of it has asked for all kernels, and one that begins in its noise; they would go on for seconds
LOOKS, LOOKS_IN_NOISE = 800, 450
SHOWN_EVERY_S = 0.2


@njit(cache=True)
def _first_run_mark(number):  # pragma: no cover - compiled
    """Cached like the others, in a moment: where it has to be compiled, they have to be too."""
    return number + 1


@njit(cache=True)
def _first_cloud_mark(number):  # pragma: no cover - compiled
    """As `_first_run_mark`, of the kernels that clouds alone need."""
    return number + 2


def compile_kernels(stream: TextIO, cloud: bool = False) -> float:
    """Compile what a fit needs unless this machine has it, and say so on `stream`; the seconds that it took.

    With what a `cloud` needs, where it is one. Where that is stopped half-way, the next run goes on with it.
    """
    start = time.perf_counter()
    for stage in (MESHES, CLOUDS) if cloud else (MESHES,):
        _compile_stage(stage, stream)
    return time.perf_counter() - start


def _compile_stage(stage: KernelSet, stream: TextIO) -> None:
    start, before = time.perf_counter(), _misses(stage)
    _forget_old_mark(stage)
    stage.mark(1)
    if _misses(stage) > before:
        _forget_unreadable(Path(stage.mark.stats.cache_path))
        alone = count_cores() < 2
        try:
            with _uncollected(), without_copies(), _Counter(stage, stream, alone) as counter, _helper(stage, alone):
                stage.compile()
        except BaseException:
            _forget_mark(stage)
            raise
        counter.conclude(time.perf_counter() - start)


def compile_second_half() -> None:
    """Compile the best region of an outline, which this process's are made of, and the kernels that say what a program is worth, in the
    order in which a first run comes to them."""
    import numpy as np

    from imdim.geometry import kernels
    from imdim.geometry.triangles import distances, triangle_tree
    from imdim.search.exact.columns import distinct_boxes, keep_maximal
    from imdim.search.front.fitness import SampledTarget, Scorer
    from imdim.search.outline_kernels import Graph, find_region

    none, pairs = np.zeros(0, np.int64), np.zeros((0, 2), np.int64)
    find_region(
        Graph(np.zeros(1, np.int64), np.zeros(0, np.bool_), none, pairs, pairs, np.zeros(0), none, none, np.zeros(0, np.int8)),
        np.zeros(1),
        0.0,
        False,
    )
    part, target, words = _small_part(), _small_target(), np.ones((1, 1), np.uint64)
    points, volumes = target.points[:64], np.ones(64)
    kernels.inside(part, points)
    distinct_boxes(words, words, words, words, words, words, 1)
    keep_maximal(words)
    kernels.program_sdf(part, points)
    Scorer(SampledTarget(points, 1.0, points, volumes, 0.0 * volumes)).score([part])
    if target.mesh is not None:
        distances(triangle_tree(target.mesh), points)
        _see_from_outside(target.mesh, points)


def compile_second_half_of_clouds() -> None:
    """Compile the kernels that search in noise, as where detection tells no inside."""
    import numpy as np

    from imdim.deadline import Deadline
    from imdim.reconstruction.mdl import reconstruct_unlabelled
    from imdim.reconstruction.observation import UnitBody
    from imdim.target.target import in_unit_frame, target_from

    body = UnitBody.of(in_unit_frame(target_from(_small_cloud()))[0], np.random.default_rng(0))
    end = Deadline(LOOKS_IN_NOISE, count().__next__)
    reconstruct_unlabelled(body, None, end, end, drawn=True)


@contextmanager
def _helper(stage: KernelSet, alone: bool) -> Iterator[None]:
    """Another process that compiles the second half, unless there is no core for it; it never outlives the block."""
    if alone:
        yield
        return
    # not its name, which is none that a process knows where this is the command itself, as at an installation
    module = f"{__package__}.{Path(__file__).stem}"
    process = subprocess.Popen(
        [sys.executable, "-m", module, stage.name], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield
    finally:
        process.kill()
        process.wait()


def _is_space_limited() -> bool:
    """Whether this process may not have as many addresses as it likes."""
    return resource is not None and resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY


@contextmanager
def _uncollected() -> Iterator[None]:
    """Without Python's collector of cycles, unless memory is limited: the compiler makes many small objects, and a sixth of its time goes
    into looking through them."""
    was = gc.isenabled() and not _is_space_limited()
    if was:
        gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def _forget_mark(stage: KernelSet) -> None:
    """Let the next run compile what this one did not get to."""
    for path in Path(stage.mark.stats.cache_path).glob(f"*{stage.mark.__name__}*"):
        path.unlink(missing_ok=True)


def _forget_old_mark(stage: KernelSet) -> None:
    """Compile again where a source tree has kernels that are newer than what was compiled, as after `git pull`; what is installed has all
    its files from one build."""
    compiled = [path.stat().st_mtime for path in Path(stage.mark.stats.cache_path).glob(f"*{stage.mark.__name__}*.nbi")]
    package = Path(__file__).parents[1]
    if not compiled or not (package.parents[1] / "pyproject.toml").is_file():
        return
    newer = (path for path in package.rglob("*.py") if path.stat().st_mtime > max(compiled))
    if any(KERNEL in path.read_text(encoding="utf-8") for path in newer):
        _forget_mark(stage)


def _forget_unreadable(cache: Path) -> None:
    """Remove indexes of compiled kernels that hold what is no more, such as a class that was renamed: numba reads one before it sees that
    the source is another."""
    package = Path(__file__).parents[1]
    for index in [*(package if package in cache.parents else cache.parent).rglob("*.nbi")]:
        with index.open("rb") as file, suppress(EOFError, pickle.UnpicklingError):
            pickle.load(file)  # the version of numba
            try:
                pickle.load(file)
            except (AttributeError, ImportError):
                index.unlink(missing_ok=True)


def _misses(stage: KernelSet) -> int:
    return sum(stage.mark.stats.cache_misses.values())


class _Counter(event.Listener):
    """Counts what numba compiles, and tells of it if there is anything: on a terminal in place."""

    def __init__(self, stage: KernelSet, stream: TextIO, alone: bool) -> None:
        self._name, self._stream, self._shown, self._count = stage.name, stream, 0.0, 0
        self._how_long = f"about {stage.alone_s} s of a core" if alone else f"about {stage.shared_s} s on two cores"
        self._kernels = stage.kernels if alone else round(stage.left_to_one * stage.kernels)

    def __enter__(self) -> _Counter:
        event.register("numba:compile", self)
        return self

    def __exit__(self, *_: object) -> None:
        event.unregister("numba:compile", self)

    def on_start(self, event: Any) -> None:
        if not self._count:
            self._stream.write(f"imdim: first {self._name} on this machine: compiling, before the clock starts ({self._how_long})\n")
            self._stream.flush()
            self._count = 1

    def on_end(self, event: Any) -> None:
        self._count += 1
        if self._stream.isatty() and time.perf_counter() > self._shown + SHOWN_EVERY_S:
            self._shown = time.perf_counter()
            self._stream.write(f"\r  {self._count} of about {self._kernels} kernels\r")
            self._stream.flush()

    def conclude(self, seconds: float) -> None:
        """The last word, where there was a first."""
        if self._count:
            self._stream.write(f"imdim: compiled in {seconds:.0f} s, kept for later runs\n")


def _reconstruct_small_part() -> None:
    """From a mesh to scores: a plate with a slot, a hole and a rounded end, which takes outlines, cutters and round faces."""
    from imdim.delivery.evaluate import evaluate
    from imdim.geometry.solid import to_manifold, to_trimesh
    from imdim.reconstruction.config import Settings
    from imdim.reconstruction.pipeline import reconstruct_best

    target = _small_target()
    for language in ("cad", "csg"):
        found = reconstruct_best(target, Settings(budget_s=600.0, language=language))
        evaluate(found.program, target, samples=100)
    _see_from_outside(to_trimesh(to_manifold(found.program)), target.points)


def _reconstruct_small_cloud() -> None:
    """And what an outline tells of it: calm clouds need no other kernels."""
    import numpy as np

    from imdim.numbers.em import EMConfig, maximise_likelihood
    from imdim.numbers.likelihood import Noise
    from imdim.reconstruction.config import Settings
    from imdim.reconstruction.pipeline import reconstruct
    from imdim.target.target import target_from

    cloud = _small_cloud()
    maximise_likelihood(_small_part(), cloud, Noise(BLUR), EMConfig(rounds=2))
    list(reconstruct(target_from(cloud), Settings(budget_s=LOOKS, checkpoint="none"), np.random.default_rng(0), count().__next__))


def _see_from_outside(surface: Trimesh, points: np.ndarray) -> None:
    """What delivery alone asks for, and bodies in layers."""
    from imdim.geometry.kernels import outline_sdf
    from imdim.geometry.lowering import Outlines
    from imdim.geometry.polygon_arcs import draw_ring
    from imdim.geometry.visible import faces_seen
    from imdim.geometry.winding import winding_number
    from imdim.program.outline import Outline, circle

    outline_sdf(Outlines.pack([Outline((circle(1.0),))]).curves, points[:1, :2])
    draw_ring(points[:3, :2], 0.0)
    winding_number(surface, points[:1])
    faces_seen(surface.triangles, 1, 1)


def _small_target() -> Target:
    from imdim.geometry.solid import to_manifold, to_trimesh
    from imdim.target.target import target_from

    return target_from(to_trimesh(to_manifold(_small_part())), "first run")


def _small_cloud() -> np.ndarray:
    """A few noisy points [n, 3] of the small part."""
    import numpy as np

    rng, points = np.random.default_rng(0), _small_target().points
    few = points[rng.choice(len(points), FEW_POINTS, replace=False)]
    return few + BLUR * rng.standard_normal(few.shape)


def _small_part() -> Combine:
    from imdim.program.outline import Outline, circle
    from imdim.program.tree import Combine, Primitive

    plate = ((-8.0, -3.0, 0.0), (8.0, -3.0, 1.0), (8.0, 3.0, 0.0), (-8.0, 3.0, 0.0))  # x, y, bulge: 1 is half a circle
    link = Primitive("extrude", (4.0,), outline=Outline((plate, circle(1.0, 8.0))))
    return Combine("difference", link, Primitive("box", (4.0, 3.0, 2.0), center=(-4.0, 0.0, 1.5)))


class KernelSet(NamedTuple):
    """Kernels that are compiled at once, known by their `mark`: by `compile`, and with another process's `compile_half`.

    To say how long that takes and how far it is: the seconds on one core and on two, about how many `kernels` there are, and the share of
    them that is left to this process by the other.
    """

    name: str
    mark: Any
    compile: Callable[[], None]
    compile_half: Callable[[], None]
    alone_s: int
    shared_s: int
    kernels: int
    left_to_one: float


MESHES = KernelSet("run", _first_run_mark, _reconstruct_small_part, compile_second_half, 60, 40, 290, 0.55)
CLOUDS = KernelSet("cloud", _first_cloud_mark, _reconstruct_small_cloud, compile_second_half_of_clouds, 30, 25, 130, 0.6)


def main(arguments: list[str]) -> None:
    """Compile `all` that fits need, or the half of a stage that its name asks for."""
    if arguments == ["all"]:
        compile_kernels(sys.stderr, cloud=True)
        return
    with _uncollected(), without_copies():
        {stage.name: stage.compile_half for stage in (MESHES, CLOUDS)}[arguments[0]]()


if __name__ == "__main__":
    main(sys.argv[1:])
