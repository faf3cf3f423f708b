"""Noisy clouds: the program with the shortest description of the points (MDL), and the numbers that make them most likely."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.detection.mesh_noise import DEVIATION
from imdim.geometry import kernels
from imdim.geometry.axes import clearest_axes, find_shared_axes, main_axes
from imdim.geometry.sampling import subsample
from imdim.geometry.shadows import Shadows
from imdim.numbers.em import EMConfig, FittedProgram, maximise_likelihood
from imdim.numbers.likelihood import Noise
from imdim.numbers.ties import tie_alike
from imdim.program.paths import leaf_paths, without
from imdim.program.rewrite.simplify import reduce_program
from imdim.program.sequence import Step, to_program, to_sequence
from imdim.program.tree import Primitive, Program, leaves
from imdim.reconstruction.delivery_time import ALLOWED_AFTER_S, leave_time_to_deliver
from imdim.reconstruction.likely_numbers import CAREFUL, MOST_POINTS, NUMBERS_SHARE, SAME, NoisyFit, fit_numbers, hold_relations
from imdim.reconstruction.observation import Observation, UnitBody
from imdim.reconstruction.policy_beam import PolicyOf, beam_programs, has_time_for_beam, next_parts, proposals
from imdim.reconstruction.trifles import without_trifles
from imdim.search.mdl.blurred_skins import may_hide_skins
from imdim.search.mdl.candidates.drawn import retrace, take_holes_apart, take_loops_apart
from imdim.search.mdl.candidates.pockets import pockets
from imdim.search.mdl.candidates.shell_slot import compounds
from imdim.search.mdl.description_length import PARALLEL_DEG, length_of
from imdim.search.mdl.lineages import Lineage, choose_heirs, count_with_time, run_in_turn
from imdim.search.mdl.part_tables import PartTableCache
from imdim.search.mdl.primitive_selection import Cloud, distinct
from imdim.search.mdl.search import FEWER, FIRST, OWN, REFIT, best_by_mdl, shorten, tables_of_subsample
from imdim.search.mdl.silhouettes import outlines
from imdim.side_process import map_beside
from imdim.target.target import sample_surface

QUICK_POINTS = 4096
LINEAGES = 2  # programs of a policy that are searched from
ASK_S = 2.0  # what asking takes of the processor
MOST_ASKED = 6  # times that a policy is asked for more
MOST_DRAWN, OF_EACH = 16, 3  # outlines that the points show, of which more than one may go through the same walls; and of each kind
SCANNED, VIEWED = 1000, 500  # points of a scanned mesh, and of what a depth camera saw, whose waves are longer
COUNTED = 0.66  # of these
OFF = 2.0  # deviations of real things, by which one may be off in one place: what follows that is no feature
FLOOR = 0.25  # of the deviation of real things, that their noise is taken for at least: a small face bulges less than the whole
BLURRED_SKINS = 1.45  # times the noise that two skins seem to have that are hardly told from one
SKINS = 0.3  # of a program's surface on walls thinner than the noise, from which there may be less noise
FALLEN = 0.85  # of the noise that was told is left where it was skins
DRAW_SHARE = 0.35  # of the time, for what the points show before a search begins
FIRST_SHARE = 0.4  # of the time, for searches that begin with little
REBUILT, MOST_REBUILT = 8, 60  # times in a row that leaves are taken out in vain, and times at all
MOST_TAKEN = 3  # leaves at once
THROUGH = 4.0  # deviations of the noise by which holes go beyond what they go through
NEAR_COPIES = (1.0, 0.5)  # deviations of the noise by which the shapes of leaves differ that may be copies
SEED = 0  # of which: the same cloud is always searched alike
ASTRAY = (2.0, 8.0)  # deviations of the noise between which a point is explained badly and no stray
DOUBTED = 10.0  # times as likely as others
FITTED = 3  # starts whose numbers are fitted before one is chosen
SPARE_SHARE = 0.5  # of the time in which numbers are fitted, for leaves that are not worth theirs
SPARE = 5e-4  # nats per point that a leaf is worth at least: the samples leave more in doubt
KEPT = 3  # leaves in a row that are worth their numbers, by how little they seem to be, after which the others are
BEGUN = EMConfig(rounds=8)
SLOW = 0.01  # nats per point that a round wins where taking leaves out may win more


def reconstruct_unlabelled(
    body: UnitBody,
    policy: PolicyOf | None,
    choose_by: Deadline,
    fit_by: Deadline = NEVER,
    calm: bool = False,
    drawn: bool = False,
    written: bool = False,
) -> NoisyFit | None:
    """A program of a cloud of which detection cannot tell the inside, in the unit frame: of a noisy one as `most_likely` finds it, from
    what a policy has `written` if that is asked for, of a calm one what a policy's beam comes to.

    None for a mesh and, unless `calm` ones are asked for too, a calm cloud, which then have no inside, and where nothing is left of the
    cloud. Time as for `most_likely`.
    """
    points, noise = body.target.points, body.noise
    if body.target.mesh is not None or not (noise.blurs or calm):
        return None
    first = policy() if policy is not None and (written or not noise.blurs) else None
    found = [p.program for p in proposals(first, points, noise.sigma, deadline=choose_by)]
    if not found or not noise.blurs:
        return NoisyFit(found[0], (), choose_by.has_passed()) if found else None
    cloud = _NoisyCloud.of(points, noise.sigma, drawn=drawn, scanners=body.target.scanners)
    return replace(cloud, policy=policy).find_shortest(found, choose_by, fit_by)


def reconstruct_scan(body: UnitBody, rng: np.random.Generator, choose_by: Deadline, fit_by: Deadline, drawn: bool) -> NoisyFit | None:
    """A program of a body whose surface bulges, in its unit frame, from points of its surface; None where nothing is left of them.

    Rounded edges, bulges and dents of a real thing, and the waves of a camera, are no features: they count as noise, and since they go on
    over many facets or points, few points say as much of it as many do. The policy is not asked: it takes a tenth of the time, and knows no
    scans. Nor are parts looked for anew, which would follow what a real thing deviates by. Time as for `most_likely`.
    """
    mesh, sigma = body.target.mesh, max(body.noise.sigma, DEVIATION)
    if mesh is None:
        points, trifle = subsample(body.target.points, VIEWED), sigma
    else:
        points, trifle = sample_surface(mesh.vertices, np.asarray(mesh.faces), SCANNED, rng)[0], DEVIATION
    found = [p.program for p in proposals(None, points, sigma, deadline=choose_by)]
    cloud = _NoisyCloud.of(points, sigma, drawn=drawn, trifle=trifle, scanners=body.target.scanners)
    return replace(cloud, anew=False).find_shortest(found, choose_by, fit_by) if found else None


def most_likely(
    programs: Sequence[Program],
    seen: Observation,
    choose_by: Deadline,
    fit_by: Deadline = NEVER,
    drawn: bool = False,
    policy: PolicyOf | None = None,
    anew: bool = True,
) -> NoisyFit:
    """The program that tells a noisy cloud in the shortest description, with the relations that the points support.

    `programs`, of which the last is tried in any case, are where the search for it starts; all lend their primitives. Outlines are among
    them if they may be `drawn`. Where these searches leave time, leaves of the shortest are looked for `anew`, and in the end a `policy` is
    asked what it would write and what it would add. The search ends at `choose_by`,
    and the numbers of its program are fitted until `fit_by` (by default to the end).
    """
    shared = find_shared_axes([p.surface.axis for p in seen.patches], [p.area for p in seen.patches])
    points, scanners = seen.target.points, seen.target.scanners
    cloud = _NoisyCloud.of(points, seen.noise.sigma, shared, drawn=drawn, scanners=scanners)
    return replace(cloud, policy=policy, anew=anew).find_shortest(programs, choose_by, fit_by)


@dataclass(frozen=True)
class _NoisyCloud:
    """A noisy cloud: points [n, 3], the deviation of their noise, the part's directions as columns [3, 3]; outlines if `drawn`. What moves
    the surface by no more than OFF times `trifle`, the deviation of real things in a scan, is no feature. The `shadows` are those of known
    scanners. The `policy`, if any, is asked for more parts, and in the end leaves are looked for `anew`."""

    points: np.ndarray
    sigma: float
    axes: np.ndarray
    drawn: bool
    trifle: float = 0.0
    shadows: Shadows | None = None
    policy: PolicyOf | None = None
    anew: bool = True

    @staticmethod
    def of(
        points: np.ndarray, sigma: float, *known: np.ndarray, drawn: bool, trifle: float = 0.0, scanners: np.ndarray | None = None
    ) -> _NoisyCloud:
        """With the clearest of the directions: those `known` from surfaces, those of the points, and the given axes."""
        frames = [*known, main_axes(points[:QUICK_POINTS]), np.eye(3)]
        shadows = None if scanners is None else Shadows.of(points, scanners, sigma)
        return _NoisyCloud(points, sigma, clearest_axes(points, frames, 2 * sigma), drawn, trifle, shadows)

    @property
    def _noise(self) -> Noise:
        """What the noise is before a program tells more of it."""
        return Noise(self.sigma, least=FLOOR * self.trifle, shadows=self.shadows)

    @property
    def _count(self) -> int:
        """Of the points that fit the numbers in the end: a search that weighed numbers by the fewer points that it looks at would leave out
        what they all show. Of the points of a scan fewer count: what deviates goes on over many of them."""
        return min(len(self.points), MOST_POINTS) if not self.trifle else round(COUNTED * len(self.points))

    @cached_property
    def quick(self) -> np.ndarray:
        return subsample(self.points, QUICK_POINTS)

    @cached_property
    def _draws(self) -> PartTableCache:
        return tables_of_subsample(self.quick, self.shadows)

    @cached_property
    def _cloud(self) -> Cloud:
        return Cloud.of(self.quick, self.sigma)

    def find_shortest(self, programs: Sequence[Program], choose_by: Deadline, fit_by: Deadline) -> NoisyFit:
        """The program with the shortest description, by a search from one primitive, then from the best of `programs`, then from both."""
        draw_by = choose_by.ahead(DRAW_SHARE * choose_by.left())
        shown = outlines(self.points, self.axes, self.sigma, deadline=draw_by, drawn=self.drawn)
        found = self._best_drawn(distinct(shown.primitives, self._cloud)) if shown.primitives else []
        found = self._best_drawn(distinct([*found, *self._retraced(found, draw_by)], self._cloud))
        seen = [*found, *compounds(found, self._cloud, self.sigma), *pockets(shown.primitives, self._cloud)]
        candidates = [*seen, *dict.fromkeys(leaf for p in programs for leaf in leaves(p))]
        best, left_out = self._search(programs, candidates, choose_by)
        cut = shown.cut or left_out or choose_by.has_passed()
        fit_by = leave_time_to_deliver(best.program, fit_by, ALLOWED_AFTER_S)
        points = subsample(self.points, MOST_POINTS)
        best = best if self.trifle else self._without_spare(best, fit_by.ahead(SPARE_SHARE * fit_by.left()))
        shorter = reduce_program(without_trifles(best.program, OFF * self.trifle, fit_by, self.shadows), deadline=fit_by)
        numbers_by = fit_by.ahead(NUMBERS_SHARE * fit_by.left())
        program, constraints = hold_relations(fit_numbers(shorter, points, best.noise, numbers_by, CAREFUL), points, fit_by)
        return NoisyFit(program, constraints, cut or numbers_by.has_passed())

    def _best_drawn(self, found: Sequence[Primitive]) -> list[Primitive]:
        """Without all but the MOST_DRAWN outlines that alone describe the points in the shortest way, and some of each kind."""
        drawn = [p for p in found if p.outline is not None]
        ranked = best_by_mdl(drawn, self._draws, self._noise, len(drawn)) if len(drawn) > MOST_DRAWN else drawn
        best = [p for p in ranked if isinstance(p, Primitive)]
        kept = {*best[:MOST_DRAWN], *(p for kind in ("revolve", "extrude") for p in [q for q in best if q.kind == kind][:OF_EACH])}
        return [p for p in found if p.outline is None or p in kept]

    def _retraced(self, found: Sequence[Primitive], deadline: Deadline) -> Iterator[Primitive]:
        """Outlines, each fitted as if it were all there is, drawn anew through the points beside it."""

        late = False

        def drawn_anew(part: Primitive) -> list[Primitive]:
            nonlocal late
            late = late or deadline.has_passed()
            if late:
                return []
            likely = maximise_likelihood(part, self.quick[::FEWER], self._noise, FIRST, deadline)
            near = np.abs(kernels.program_sdf(likely.program, self.quick)) < OWN * self.sigma
            return [*retrace(likely.program, self.quick[near], self.sigma)] if isinstance(likely.program, Primitive) else []

        return chain.from_iterable(map_beside(drawn_anew, [part for part in found if part.outline is not None]))

    def _search(self, programs: Sequence[Program], candidates: Sequence[Program], deadline: Deadline) -> tuple[FittedProgram, bool]:
        """The shortest that several searches come to which share the time: from the best primitive or wall, from the best drawing of each
        kind, and from the best of `programs` with and without drawings, as far as there is time for them in this order. What grows from
        one part is quick and stays short; `programs` are long, and what is wrong in them is hard to get out. What the others found is
        offered to the best. Also whether there was no time for some of them.
        """
        if deadline.has_passed() or not candidates:
            return self._first(programs, deadline), deadline.has_passed()
        singles = [p for p in candidates if isinstance(p, Primitive)]
        plain = [p for p in candidates if all(leaf.outline is None for leaf in leaves(p))]
        # with what the others begin with each would become as they are
        drawn = [[p for p in singles if p.outline is not None and p.kind == kind] for kind in ("revolve", "extrude")]
        groups = [(plain, plain), *((own, [*plain, *own]) for own in drawn)]
        starts = [(self._first(some, deadline), offered) for some, offered in groups if some]
        has_drawings = [any(leaf.outline is not None for leaf in leaves(p)) for p in programs]
        apart = ([p for p, has in zip(programs, has_drawings, strict=True) if has == wanted] for wanted in (True, False))
        starts.extend((self._start(some, deadline), candidates) for some in apart if some)
        first = deadline.ahead(FIRST_SHARE * deadline.left())
        begun = [self._lineage(s, offered, first) for s, offered in starts]
        left = first.left()
        most = count_with_time(left, begun[0].time_round(first))
        found = run_in_turn(begun[:most], first)
        end, deadline = deadline, leave_time_to_deliver(found[0].best.program, deadline)
        offered = [*candidates, *(leaf for other in found[1:] for leaf in leaves(other.best.program))]
        copies = not self.trifle
        heirs = choose_heirs(found, first.has_passed())
        slow = SLOW if self.anew else 0.0
        going = [Lineage(h.best, h.length, self._shorten(h.best, offered, deadline, copies=copies)) for h in heirs]
        going += [self._begin_with_copies(start, offered, deadline) for h in heirs if copies and (start := self._apart(h.best, deadline))]
        blurred = [h.best for h in heirs if self._hides_skins(h.best)]
        calmer = [self._begin_in_less_noise(likely, offered, deadline) for likely in blurred]
        shortest = run_in_turn([*going, *calmer], deadline, slow, lambda program: leave_time_to_deliver(program, end))[0]
        told = next((likely for likely, lineage in zip(blurred, calmer, strict=True) if lineage is shortest), shortest.best)
        deadline = leave_time_to_deliver(shortest.best.program, end)
        late = not blurred and self._hides_skins(shortest.best)
        best = self._in_less_noise(shortest.best, offered, deadline) if late else shortest.best
        cloud = replace(self, sigma=self._in_less(told)) if best.noise.sigma < FALLEN * told.noise.sigma else self
        if not self.trifle:
            best = cloud._copy(best, offered, deadline)
        best = cloud._rebuild_and_shorten(best, offered, deadline) if self.anew else best
        left_out = most < len(begun) or (self.policy is not None and not has_time_for_beam(deadline))
        asked = cloud._ask(best, offered, deadline)
        return (cloud._rebuild_and_shorten(asked, offered, deadline) if self.anew and asked is not best else asked), left_out

    def _without_spare(self, best: FittedProgram, deadline: Deadline) -> FittedProgram:
        """The best without the leaves that are not worth their numbers, those first that seem worth the least: a search that time has cut
        leaves some where others do their work."""
        without_one = {less: i for i, (path, _) in enumerate(leaf_paths(best.program)) if (less := without(best.program, [path]))}
        stay, kept = [*range(sum(1 for _ in leaves(best.program)))], 0
        least = best_by_mdl([*without_one], self._draws, best.noise, len(without_one)) if without_one else []
        for less in least:
            if deadline.has_passed() or kept == KEPT:
                break
            paths = [path for path, _ in leaf_paths(best.program)]
            program = without(best.program, [paths[stay.index(without_one[less])]])
            fitted = maximise_likelihood(program, self.quick, best.noise, REFIT, deadline) if program else best
            kept += 1
            if fitted is not best and self._length(fitted) < self._length(best) + SPARE:
                best, kept = fitted, 0
                stay.remove(without_one[less])
        return best

    def _hides_skins(self, likely: FittedProgram) -> bool:
        """Whether both skins of walls may have been taken for one; what a real thing deviates by is no noise that its points could tell."""
        return not self.trifle and (likely.skin > SKINS or may_hide_skins(likely.program, self.quick, likely.noise.sigma))

    def _in_less(self, likely: FittedProgram) -> float:
        """The deviation of the noise if it seems larger for skins that were taken for one: to a program that runs between them, and to the
        points, since no place without such skins may be calm enough to tell."""
        return min(likely.noise.sigma, self.sigma) / BLURRED_SKINS

    def _begin_in_less_noise(self, likely: FittedProgram, offered: Sequence[Program], deadline: Deadline) -> Lineage:
        """A search from a program as if there were less noise than it tells."""
        less = self._in_less(likely)
        start = maximise_likelihood(likely.program, self.quick, replace(likely.noise, sigma=less), REFIT, deadline)
        return Lineage(start, self._length(start), replace(self, sigma=less)._shorten(start, offered, deadline))

    def _in_less_noise(self, best: FittedProgram, offered: Sequence[Program], deadline: Deadline) -> FittedProgram:
        """The best, or what the search comes to from it in less noise, where that is shorter."""
        lineage, length = self._begin_in_less_noise(best, offered, deadline), self._length(best)
        while (
            lineage.advance() and lineage.promised < length and (lineage.won > SLOW or lineage.best.noise.sigma < FALLEN * best.noise.sigma)
        ):
            pass
        return lineage.best if lineage.length < length - SAME else best

    def _copy(self, best: FittedProgram, offered: Sequence[Program], deadline: Deadline) -> FittedProgram:
        """The best, or what the search comes to from it with its copies tied to one another, and from it with the holes of drawings as cuts
        of their own, where that is shorter."""
        tied = self._tie(best, deadline)
        starts = [tied if tied is not best else None, self._apart(best, deadline)]
        lineages = [self._begin_with_copies(start, offered, deadline) for start in starts if start]
        found = min([best, *(lineage.best for lineage in run_in_turn(lineages, deadline))], key=self._length)
        return self._tie(found, deadline)

    def _apart(self, best: FittedProgram, deadline: Deadline) -> FittedProgram | None:
        """The best with the holes of its drawings as cuts of their own, tied where alike; None where there are none, or no time."""
        apart = None if deadline.has_passed() else _with_holes_apart(best.program, best.noise.sigma)
        return self._tie(maximise_likelihood(apart, self.quick, best.noise, REFIT, deadline), deadline) if apart else None

    def _begin_with_copies(self, start: FittedProgram, offered: Sequence[Program], deadline: Deadline) -> Lineage:
        return Lineage(start, self._length(start), self._shorten(start, offered, deadline, copies=True))

    def _tie(self, best: FittedProgram, deadline: Deadline) -> FittedProgram:
        """The best with one shape for leaves whose shapes hardly differ, and with even places, as far as that makes it shorter."""
        for near in NEAR_COPIES:
            tied = tie_alike(best.program, near * best.noise.sigma, PARALLEL_DEG)
            if deadline.has_passed() or tied == best.program:
                continue
            fitted = maximise_likelihood(tied, self.quick, best.noise, REFIT, deadline)
            best = fitted if self._length(fitted) < self._length(best) else best
        return best

    def _rebuild_and_shorten(self, best: FittedProgram, offered: Sequence[Program], deadline: Deadline) -> FittedProgram:
        """The best after leaves of it were looked for anew, and then in single changes to where none shortens it, in turn until neither
        does: the last changes are as slow as any, and most of them are undone where what they mend was wrong."""
        while not deadline.has_passed():
            best = self._rebuild(best, offered, deadline)
            last = Lineage(best, self._length(best), self._shorten(best, offered, deadline))
            if not last.advance():
                break
            while last.advance():
                pass
            best = last.best
        return best

    def _rebuild(self, best: FittedProgram, offered: Sequence[Program], deadline: Deadline) -> FittedProgram:
        """The best with what becomes of it where some of its leaves, neighbours of one another, are taken out and looked for anew (large
        neighbourhood search, Shaw 1998): what two wrong parts explain together no single change undoes."""
        rng = np.random.default_rng(SEED)
        length, taken, failed = self._length(best), set[Program](), 0
        for _ in range(MOST_REBUILT):
            less = _without_neighbours(best.program, self.quick, best.noise.sigma, rng)
            if failed == REBUILT or deadline.has_passed():
                break
            if less is None or less in taken:
                continue
            taken.add(less)
            start = maximise_likelihood(less, self.quick, best.noise, REFIT, deadline)
            rounds = self._shorten(start, [*offered, *leaves(best.program)], deadline, filling=True)
            lineage = Lineage(start, self._length(start), rounds)
            while lineage.advance() and lineage.promised < length and (lineage.length > length - SAME or lineage.won > SLOW):
                pass
            failed += 1
            if lineage.length < length - SAME:
                best, length, failed = lineage.best, lineage.length, 0
        return best

    def _ask(self, best: FittedProgram, offered: Sequence[Program], deadline: Deadline) -> FittedProgram:
        """The best, or what the search comes to from the likeliest that the policy writes, with what the policy would add to it, again and
        again until that is nothing of worth. A policy and what it runs on take seconds to load."""
        policy = self.policy() if self.policy is not None and has_time_for_beam(deadline) else None
        if policy is None:
            return best
        best = self._read(beam_programs(policy, self.points), best, offered, deadline)
        for seed in range(MOST_ASKED):
            if deadline.left() < ASK_S:
                break
            offered = next_parts(policy, self.points, best.program, seed)
            single = distinct([p for p in offered if isinstance(p, Primitive)], self._cloud)
            parts = [*single, *dict.fromkeys(p for p in offered if not isinstance(p, Primitive))]
            found = [found for found, _ in self._shorten(best, parts, deadline)]
            if not found:
                break
            best = found[-1]
        return best

    def _read(self, written: Sequence[Program], best: FittedProgram, offered: Sequence[Program], deadline: Deadline) -> FittedProgram:
        """The best of what searches from the likeliest of the programs that are `written` come to while they promise more than `best`."""
        if not written:
            return best
        told = [*offered, *dict.fromkeys(leaf for p in written for leaf in leaves(p))]
        likeliest = best_by_mdl([*dict.fromkeys(written)], self._draws, self._noise, LINEAGES)
        length = self._length(best)
        for program in likeliest:
            lineage = self._lineage(self._first([program], deadline), told, deadline)
            while lineage.advance() and lineage.promised < length and (lineage.length > length - SAME or lineage.won > SLOW):
                pass
            if lineage.length < length - SAME:
                best, length = lineage.best, lineage.length
        return best

    def _shorten(
        self, start: FittedProgram, candidates: Sequence[Program], deadline: Deadline, filling: bool = False, copies: bool = False
    ) -> Iterator[tuple[FittedProgram, float]]:
        how = self._draws, self._count, self.sigma, not self.trifle, filling, copies
        return shorten(start, self.quick, candidates, self.axes, deadline, *how)

    def _lineage(self, start: FittedProgram, offered: Sequence[Program], deadline: Deadline) -> Lineage:
        return Lineage(start, self._length(start), self._shorten(start, offered, deadline))

    def _first(self, starts: Sequence[Program], deadline: Deadline) -> FittedProgram:
        """The likeliest of several programs, with its numbers fitted as far as a search needs them."""
        few = best_by_mdl([*dict.fromkeys(starts)], self._draws, self._noise, FITTED)
        fitted = map_beside(lambda p: maximise_likelihood(p, self.quick, self._noise, REFIT, deadline), few, [self.shadows])
        return min(fitted, key=self._length)

    def _start(self, programs: Sequence[Program], deadline: Deadline) -> FittedProgram:
        """The likeliest of several programs, with its numbers fitted."""
        start = self._first(programs, deadline)
        return start if deadline.has_passed() else fit_numbers(start.program, self.quick, start.noise, deadline, BEGUN)

    def _length(self, likely: FittedProgram) -> float:
        return length_of(likely, self._count)


def _with_holes_apart(program: Program, sigma: float) -> Program | None:
    """The program with the holes of its drawings as cuts behind all else, and each of several that are drawn together; None where there are
    none."""
    steps, holes = [], list[Program]()
    for op, part in to_sequence(program, apart=True):
        if op == "difference" and isinstance(part, Primitive):
            steps += [Step(op, one) for one in take_loops_apart(part)]
            continue
        plain, cuts = take_holes_apart(part, THROUGH * sigma) if isinstance(part, Primitive) else (part, [])
        steps.append(Step(op, plain))
        holes += cuts
    apart = to_program((*steps, *(Step("difference", hole) for hole in holes)))
    return apart if sum(1 for _ in leaves(apart)) > sum(1 for _ in leaves(program)) else None


def _without_neighbours(program: Program, points: np.ndarray, sigma: float, rng: np.random.Generator) -> Program | None:
    """The program without one to MOST_TAKEN of its leaves, the nearest to one of the `points` [n, 3], more likely to one that lies off the
    surface by more than the noise and is no stray; None where nothing is left."""
    paths = [path for path, _ in leaf_paths(program)]
    off = np.abs(kernels.program_sdf(program, points)) / sigma
    chance = np.where((off > ASTRAY[0]) & (off < ASTRAY[1]), DOUBTED, 1.0)
    place = points[rng.choice(len(points), p=chance / chance.sum())][None]
    away = [abs(float(kernels.program_sdf(leaf, place)[0])) for leaf in leaves(program)]
    count = int(rng.integers(1, MOST_TAKEN + 1))
    return without(program, [paths[i] for i in np.argsort(away, kind="stable")[:count]])
