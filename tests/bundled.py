"""The bundled bracket, found at once: what tests of README and notebook need beside the search that others test."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from imdim.program.codec import constraints_of, from_json
from imdim.reconstruction.pipeline import Snapshot

ROOT = Path(__file__).parents[1]


def find_bracket_at_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Give `folder` the bundled parts, and let the search answer the bracket with the program in `examples`, without compiling."""
    (folder / "dataset").symlink_to(ROOT / "dataset")
    document = json.loads((ROOT / "examples/bracket_program.json").read_text(encoding="utf-8"))

    def find_bracket(target, settings, rng):
        assert target.name == "bracket.stl"
        yield Snapshot("finished", from_json(document), 0.001, 1.0, "finished", constraints=constraints_of(document))

    monkeypatch.setattr("imdim.reconstruction.pipeline.reconstruct", find_bracket)
    monkeypatch.setattr("imdim.delivery.first_run.compile_kernels", lambda stream, cloud: 0.0)
