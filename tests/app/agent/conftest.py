"""A folder with a part, and the programs that an agent opens beside it."""

import pytest
from tests.planted import box, cut, cylinder

from imdim.app.agent.session import AgentSession
from imdim.app.agent.workplace import Workplace
from imdim.app.lab.jobs import WorkerPool
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program import codec
from imdim.program.constraints import Constraint, Ref

PLATE = cut(box(80, 50, 6), cylinder(3, 8, (-20, 0, 0)), cylinder(3, 8, (20, 0, 0)))
SAME = Constraint("equal", (Ref(1, "r"), Ref(2, "r")), name="hole_radius")


@pytest.fixture
def folder(tmp_path):
    """`part.stl` is a plate with two holes, `plate` the results folder of its program."""
    root = tmp_path / "work"
    (root / "plate").mkdir(parents=True)
    to_trimesh(to_manifold(PLATE)).export(root / "part.stl")
    (root / "plate/program.json").write_text(codec.dumps(PLATE, codec.Meta(), [SAME]))
    return root


@pytest.fixture
def session(folder, monkeypatch):
    monkeypatch.setattr(WorkerPool, "prepare", lambda pool: None)  # a process is started by those who fit
    out = AgentSession(Workplace(folder))
    yield out
    out.close()


@pytest.fixture
def opened(session):
    """With part and program open."""
    session.open("part.stl")
    session.open("plate")
    return session
