"""What the answers of a task change in the state of a client."""

from __future__ import annotations

from imdim.app.lab import naming, protocol
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.protocol import Message
from imdim.app.lab.solving import Lock, violations
from imdim.app.lab.state import CurvePoint, State
from imdim.program import codec
from imdim.program.cost import count
from imdim.program.front import Choice

MOST_STEPS = 500  # of the curves
FREE = ("fit", "continue")  # tasks that look for programs, and know no locks
TRACED = (*FREE, "solve")  # tasks that the curves show
STRIP = 8  # programs in the strip


def take_snapshot(state: State, task: str, message: Message, locks: frozenset[Lock]) -> None:
    """The program of a snapshot is the one that goes on; curves, strip and front grow."""
    values = message.values
    program, constraints = protocol.read_document(values["document"])
    edges = codec.edges_of(values["document"])
    named = values.get("named") and naming.from_values(values["named"], constraints)
    live = state.live = ConstrainedProgram(program, constraints, locks, edges, task != "continue" or bool(edges), named or None)
    state.stage = values["stage"]
    if task in FREE:
        state.proof, state.proved = values["proof"] or state.proof, program
    state.stop = values["stop"] or state.stop
    if values["notes"]:
        state.notice = ("info", " ".join(values["notes"]))
    if task in TRACED:
        state.trace = [*state.trace, _step(live, values["seconds"], values["error"])][-MOST_STEPS:]
    if task in FREE:
        _see(state, Choice(live.found, values["error"]))
        state.front = protocol.read_front(values["front"]) or state.front


def final_message(task: str, theory: ConstrainedProgram | None) -> str:
    """The line that a person reads when a task has done its work, "" where the program says it all."""
    found = len(theory.constraints) if theory else 0
    related = f"{found} relation{'' if found == 1 else 's'} found" if found else "no relations found"
    return {"solve": "fitted: all relations hold, and what is locked stayed", "relate": related}.get(task, "")


def _step(live: ConstrainedProgram, seconds: float, error: float) -> CurvePoint:
    return CurvePoint(seconds, error, count(live.program).primitives, max(violations(live.program, live.constraints), default=0.0))


def _see(state: State, choice: Choice) -> None:
    if not state.seen or state.seen[-1].program != choice.program:
        state.seen = [*state.seen, choice][-STRIP:]
