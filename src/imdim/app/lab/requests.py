"""What a working process is asked for: one message per task of `work`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from imdim.app.lab import naming, protocol
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.protocol import Message
from imdim.program import codec
from imdim.reconstruction.config import Settings
from imdim.target.target import Target

PLACES = ("input", "output", "logdir")  # settings that name files, which are none of the process's business


def request(task: str, target: Target, settings: Settings, theory: ConstrainedProgram | None = None, **values: Any) -> Message:
    """What `task` needs: the target, settings, the program of `theory` where it starts from one, and `values` of its own."""
    message = protocol.target_message(target)
    values["settings"] = {k: v for k, v in asdict(settings).items() if k not in PLACES}
    if theory is not None:
        values["find_edges"] = not theory.knows_edges
        values["named"] = naming.to_values(theory.names) if theory.names is not None and theory.names.is_final else None
        values["document"] = codec.to_json(theory.program, None, theory.constraints, edges=theory.edges)
    return Message(task, {**message.values, **values}, message.arrays)
