"""Programs of one body or several on the way to a result: what is known of them, and how they are united, moved and turned."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np

from imdim.detection.blends import Chain
from imdim.detection.noise import MeasuredNoise
from imdim.detection.toothed_rims import ToothedRim
from imdim.geometry.rotations import euler_from_matrix
from imdim.geometry.sampling import subsample
from imdim.geometry.surface import vec
from imdim.program.constraints import WORLD, Constraint
from imdim.program.cost import count
from imdim.program.front import Choice
from imdim.program.motions import move_program, step
from imdim.program.paths import leaf_paths, without
from imdim.program.tree import Primitive, Program, combine_all, leaves, map_leaves
from imdim.reconstruction.choices import unite_fronts
from imdim.reconstruction.edge_features import place_chain
from imdim.reconstruction.methods import CUT
from imdim.reconstruction.own_frame import turn_back
from imdim.reconstruction.teeth_aside import put_teeth_on
from imdim.target.target import Frame, Target

UNKNOWN = 1.0  # error of a program whose body shows no inside
NO_TIME_LEFT = "not proved: time ran out"
LOOKED_AT = 1000  # points that say how a box lies, which all of them bound
SMALLER = 0.8  # of the box along the world's axes, that one any other way has at most


@dataclass(frozen=True)
class BodyState:
    """A program of one body without its `chains` of fillets and chamfers, but with those `kept`, it and the `volume` in the body's units;
    `error` is relative to that, as `measure` gives it for any program of its structure. `found` are the relations that its points support,
    None if they were not asked. The leaves of the numbers `teeth` are those of toothed rims. `stop` is as a step's, `noisy` and `noise` as
    a snapshot's. `shows_edges` is whether its fillets and chamfers were looked for."""

    stage: str
    program: Program
    error: float
    volume: float
    measure: Callable[[Program], float]
    front: tuple[Choice, ...] = ()
    proof: str = ""
    stop: str = "finished"
    found: tuple[Constraint, ...] | None = None
    chains: tuple[Chain, ...] = ()
    kept: tuple[Chain, ...] = ()
    teeth: frozenset[int] = frozenset()
    noisy: bool = False
    noise: MeasuredNoise | None = None
    shows_edges: bool = True


def unite_states(stage: str, states: list[BodyState]) -> BodyState:
    """The union of several bodies' programs, with the error of all of them relative to their volume."""
    fronts = [s.front for s in states]
    front = unite_fronts(fronts, [s.program for s in states], [s.volume for s in states]) if all(fronts) else []
    program = combine_all("union", [s.program for s in states])
    stop, proof = join_stops([s.stop for s in states]), _proof([s.proof for s in states])
    error, volume = _mean_error([s.error for s in states], states), sum(s.volume for s in states)
    chains, kept = (tuple(chain for found in each for chain in found) for each in zip(*((s.chains, s.kept) for s in states), strict=True))
    state = BodyState(
        stage, program, error, volume, lambda p: measure_apart(p, states), tuple(front), proof, stop, states[0].found, chains, kept
    )
    before = np.cumsum([0, *(count(s.program).primitives for s in states)]).tolist()
    teeth = frozenset(first + number for s, first in zip(states, before, strict=False) for number in s.teeth)
    noises = [s.noise for s in states if s.noise is not None]
    noise = max(noises, key=lambda noise: noise.model.sigma, default=None)
    shows = all(s.shows_edges for s in states)
    return replace(state, teeth=teeth, noisy=any(s.noisy for s in states), noise=noise, shows_edges=shows)


def measure_apart(program: Program, states: Sequence[BodyState]) -> float:
    """Error of the union of several bodies' programs with other numbers than theirs, relative to the volume of all."""
    parts, errors = leaves(program), []
    for state in states:
        new = list(islice(parts, count(state.program).primitives))
        errors.append(state.measure(map_leaves(state.program, lambda i, _, new=new: new[i])))
    return _mean_error(errors, states)


def _mean_error(errors: Sequence[float], states: Sequence[BodyState]) -> float:
    """Of all bodies relative to their volume; programs of nothing have none to measure by."""
    volume = sum(s.volume for s in states)
    return sum(e * s.volume for e, s in zip(errors, states, strict=True)) / volume if volume else max(errors)


def join_stops(stops: list[str]) -> str:
    """How work on several bodies ended: cut if any was, else as the last one that tells more than that it ended."""
    telling = [stop for stop in stops if stop != "finished"]
    return CUT if CUT in telling else next(reversed(telling), "finished")


def _proof(proofs: list[str]) -> str:
    """Of several bodies: the first that is lacking, or what holds for each."""
    if len(set(proofs)) == 1:
        return proofs[0] + (f", each of {len(proofs)} bodies" if proofs[0] and len(proofs) > 1 else "")
    return next((p for p in proofs if p.startswith("not")), "")


def move_state(state: BodyState, way: np.ndarray) -> BodyState:
    """The state of a body as that of one like it, which stands elsewhere."""
    if not way.any():
        return state
    there, back = step(vec(way)), step(vec(-way))
    front = tuple(replace(choice, program=move_program(choice.program, there)) for choice in state.front)
    measure = state.measure
    return replace(
        state, program=move_program(state.program, there), front=front, measure=lambda program: measure(move_program(program, back))
    )


def turn_back_states(states: Iterable[BodyState], own: Frame) -> Iterator[BodyState]:
    """The states of a part in its own frame, in the world; relations to the axes of that frame are none to the world's."""
    for state in states:
        # relations tell of the leaves' own axes
        undo = own.undo if state.found is not None else partial(turn_back, own=own)
        found = None if state.found is None else tuple(c for c in state.found if all(ref.leaf != WORLD for ref in (*c.of, c.about) if ref))
        chains, kept = (tuple(place_chain(chain, own) for chain in each) for each in (state.chains, state.kept))
        front = tuple(replace(choice, program=undo(choice.program)) for choice in state.front)
        measure = partial(_measure_own, state.measure, own)
        yield replace(state, program=undo(state.program), front=front, measure=measure, found=found, chains=chains, kept=kept)


def _measure_own(measure: Callable[[Program], float], own: Frame, program: Program) -> float:
    return measure(own.apply(program))


def put_teeth_on_state(state: BodyState, rims: tuple[ToothedRim, ...]) -> BodyState:
    """The state of a body without the teeth of its rims as one with them; its error is that of the rest."""
    program, first = put_teeth_on(state.program, rims), count(state.program).primitives

    def measure(program: Program) -> float:
        return state.measure(without(program, [path for path, _ in leaf_paths(program)[first:]]) or program)

    front = tuple(replace(choice, program=put_teeth_on(choice.program, rims)) for choice in state.front)
    teeth = frozenset(range(first, count(program).primitives))
    return replace(state, program=program, measure=measure, front=front, teeth=teeth)


def box_state(body: Target) -> BodyState:
    """The box of a body that no time is left for. It holds the body, so that its error is what it has beyond that."""
    box = _box_around(np.asarray(body.points if body.mesh is None else body.mesh.vertices, float))
    whole = math.prod(box.size)
    volume = float(body.mesh.volume) if body.mesh is not None and body.is_solid else whole
    error = abs(whole - volume) / volume
    return BodyState("boxes", box, error, volume, lambda _: error, (Choice(box, error),), NO_TIME_LEFT, CUT)


def _box_around(points: np.ndarray) -> Primitive:
    """The box about points [n, 3], not all in one plane, along the world's axes, or the smallest any way where that is much smaller."""
    from trimesh.bounds import oriented_bounds  # few parts have bodies that no time is left for

    low, high = points.min(0), points.max(0)
    turn = oriented_bounds(subsample(points, LOOKED_AT))[0][:3, :3]
    local = points @ turn.T
    first, last = local.min(0), local.max(0)
    if math.prod(last - first) > SMALLER * math.prod(high - low):
        return Primitive("box", vec(high - low), vec((low + high) / 2))
    return Primitive("box", vec(last - first), vec(turn.T @ (first + last) / 2), euler_from_matrix(turn.T))
