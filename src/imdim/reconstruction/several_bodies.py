"""The programs of the bodies of a target, one after the other, and of a few as one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from imdim.detection.cloud_bodies import group_alike, split_cloud
from imdim.detection.noise import MeasuredNoise, measure_noise
from imdim.program.constraints import scale_constraints
from imdim.program.cost import CURVE_PRICES, weigh
from imdim.program.front import Choice
from imdim.program.outline import regions
from imdim.program.tree import Primitive, leaves
from imdim.reconstruction.body_state import BodyState, box_state, join_stops, move_state, unite_states
from imdim.reconstruction.budget import SHARES, Budget
from imdim.reconstruction.fitting import snap_measured
from imdim.reconstruction.methods import CUT
from imdim.reconstruction.one_body import Work, fit_body
from imdim.target.target import InputError, Target, in_unit_frame, split_bodies

MOST_JOINT = 8  # bodies
SEED = 0  # of the noise that tells whether a cloud is looked at body by body
FLAT = 1e-6  # of how far a body reaches, by which a scrap of one plane may leave it
JOINT_ERROR = 2e-3  # of the volume, that a shorter program of all bodies at once may cost


def fit_bodies(target: Target, work: Work, left_out: list[InputError]) -> Iterator[BodyState]:
    """States of the union of the bodies done so far; a few bodies are then tried as one, since one cut may have parted them.

    Scraps of surface beside a body are no reason to refuse it: why each was is added to `left_out`.
    """
    bodies = split_bodies(target)
    if len(parts := _parts_of_noisy_cloud(target)) > 1:
        yield from _by_noisy_body(target, parts, work)
        return
    facets = [_count_facets(body) for body in bodies]
    done: list[BodyState] = []
    for i, body in enumerate(bodies):
        if done and work.budget.end_of("search").has_passed():
            flat = [rest.name for rest in bodies[i:] if _is_flat(rest)]
            left_out += [InputError(f"{name}: flat, it has no inside") for name in flat]
            done += [box_state(rest) for rest in bodies[i:] if rest.name not in flat]
            if boxes := len(bodies) - i - len(flat):
                work.notes.append(f"no time was left for {boxes} of {len(bodies)} bodies: they are boxes")
            yield unite_states("boxes", done)
            break
        state = None
        try:
            # many facets may be one ball: no body has less than an equal part of the time that is left
            share = max(facets[i] / sum(facets[i:]), 1 / (len(bodies) - i))
            for state in fit_body(body, replace(work, alone=len(bodies) == 1), share):
                yield unite_states(state.stage, [*done, state])
        except InputError as error:
            left_out.append(error)
        done += [state] if state else []
    if not left_out and 1 < len(done) <= MOST_JOINT:
        yield from _jointly(target, work, unite_states(done[-1].stage, done))


def _parts_of_noisy_cloud(target: Target) -> list[np.ndarray]:
    """Indices of the points of each body of a noisy cloud where several stand clearly apart; none of other targets. Known scanners see past
    all bodies, so that their cloud stays whole, and so does a calm one, whose cells tell bodies apart."""
    if target.mesh is not None or target.scanners is not None or len(split_cloud(target.points, 0.0)) == 1:
        return []
    noise = measure_noise(target.points, np.random.default_rng(SEED))[0]
    return split_cloud(target.points, noise.sigma) if noise.blurs else []


def _by_noisy_body(target: Target, parts: Sequence[np.ndarray], work: Work) -> Iterator[BodyState]:
    """States of the union of the bodies of a noisy cloud done so far, of which `parts` are the indices of their points, and then with its
    numbers fitted to all points. Bodies that are alike are looked at as one, with the points of all.

    Each has its share of the time until a program must be chosen, and of that its own stages.
    """
    from imdim.reconstruction.likely_numbers import settle_together

    noise = MeasuredNoise(*measure_noise(target.points, np.random.default_rng(SEED)))
    done, sigma = list[BodyState](), noise.model.sigma
    groups = group_alike([target.points[own] for own in parts], sigma)
    bodies = [_gather(target, [(parts[i], way) for i, way in group], f"{target.name} body {group[0][0] + 1}") for group in groups]
    for number, (group, body) in enumerate(zip(groups, bodies, strict=True)):
        share = len(body.points) / sum(len(rest.points) for rest in bodies[number:])
        own = Budget(share * work.budget.end_of("choose").left() / SHARES["measure"].by, work.budget.now)
        if own.whole_s <= 0:
            work.notes.append(f"no time was left for {len(bodies) - number} of {len(bodies)} bodies: they are boxes")
            done += [
                move_state(box_state(rest), way) for rest, ways in zip(bodies[number:], groups[number:], strict=True) for _, way in ways
            ]
            break
        try:
            for state in fit_body(body, replace(work, budget=own, alone=False)):
                alike = [move_state(state, way) for _, way in group]
                yield unite_states(state.stage, [*done, *alike])
        except InputError as error:
            work.notes.append(f"{error}; left out")
            continue
        done += alike
    if not done:
        raise InputError(f"{target.name}: no solid explains any of its {len(parts)} bodies")
    (unit, frame), last = in_unit_frame(target), unite_states("joint", done)
    likely = settle_together(frame.apply(last.program), unit.points, sigma * frame.scale, work.budget.end_of("likely"))
    found = scale_constraints(likely.constraints, 1 / frame.scale)
    program = snap_measured(frame.undo(likely.program), found, target.points, work.budget.end_of("measure"))
    error, stop = last.measure(program), CUT if likely.cut else last.stop
    front = (Choice(program, error),)
    yield replace(last, program=program, error=error, front=front, found=found, noisy=True, noise=noise, stop=stop)


def _gather(target: Target, alike: Sequence[tuple[np.ndarray, np.ndarray]], name: str) -> Target:
    """The points of bodies that are alike in the place of the first, by their indices and the ways [3] from it."""
    every = np.concatenate([own for own, _ in alike])
    points = np.concatenate([target.points[own] - way for own, way in alike])
    return replace(target, name=name, points=points, normals=None if target.normals is None else target.normals[every])


def _count_facets(body: Target) -> int:
    """Facets of a body, or points of a cloud's: a dozen scraps beside a part take none of its time."""
    return max(1, len(body.points) if body.mesh is None else len(body.mesh.faces))


def _is_flat(body: Target) -> bool:
    """Whether a body is a scrap of one plane, whose box would hold nothing."""
    points = np.asarray(body.points if body.mesh is None else body.mesh.vertices)
    spans = np.linalg.svd(points - points.mean(0), compute_uv=False)
    return bool(spans[-1] <= FLAT * spans[0])


def _jointly(target: Target, work: Work, apart: BodyState) -> Iterator[BodyState]:
    """The bodies as one where that is shorter, or `apart` where time has cut the attempt. Two bodies in one drawing are not shorter."""
    if work.budget.end_of("search").has_passed():
        yield replace(apart, stop=CUT)
        return
    try:
        *_, joint = fit_body(target, work)
    except InputError:  # all is told by the bodies
        return
    curve = CURVE_PRICES[work.settings.counted]
    shorter = weigh(joint.program, curve) < weigh(apart.program, curve) and not any(_is_in_pieces(leaf) for leaf in leaves(joint.program))
    if shorter and joint.error < apart.error + JOINT_ERROR:
        yield replace(joint, stage="joint", stop=join_stops([apart.stop, joint.stop]))
    elif joint.stop == CUT:
        yield replace(apart, stop=CUT)


def _is_in_pieces(leaf: Primitive) -> bool:
    """Whether an outline has several separate areas."""
    return leaf.outline is not None and len(regions(leaf.outline)) > 1
