"""What a working process is asked for: one message per task of `work`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from imdim.app.lab import protocol
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.protocol import Message
from imdim.app.lab.resume import Rates
from imdim.program.front import Choice
from imdim.reconstruction.config import Settings
from imdim.target.target import Target

PLACES = ("input", "output", "logdir")  # settings that name files, which are none of the process's business


def fit(target: Target, settings: Settings) -> Message:
    """A reconstruction from nothing."""
    return _request("fit", target, settings=_plain(settings))


def go_on(target: Target, settings: Settings, theory: ConstrainedProgram, rates: Rates) -> Message:
    """Evolution from the program of `theory`."""
    return _request("continue", target, settings=_plain(settings), document=_document(theory), rates=asdict(rates))


def solve(target: Target, theory: ConstrainedProgram) -> Message:
    """The numbers of `theory` fitted; its constraints and locks hold."""
    locks = [[lock.leaf, lock.name] for lock in sorted(theory.locks)]
    return _request("solve", target, document=_document(theory), locks=locks)


def relate(target: Target, theory: ConstrainedProgram) -> Message:
    """The relations among the numbers of `theory`."""
    return _request("relate", target, document=_document(theory))


def files(target: Target, settings: Settings, theory: ConstrainedProgram, front: Sequence[Choice], stop: str) -> Message:
    """All files of the program of `theory`."""
    return _request("files", target, settings=_plain(settings), document=_document(theory), front=protocol.front_values(front), stop=stop)


def _request(kind: str, target: Target, **values: Any) -> Message:
    message = protocol.target_message(target)
    return Message(kind, {**message.values, **values}, message.arrays)


def _plain(settings: Settings) -> dict[str, Any]:
    return {k: v for k, v in asdict(settings).items() if k not in PLACES}


def _document(theory: ConstrainedProgram) -> dict[str, Any]:
    return protocol.document(theory.program, theory.constraints)
