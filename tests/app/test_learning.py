"""The commands that train end in a line where somebody stops them."""

from pathlib import Path

import pytest

from imdim.app import learning, pretrain, reinforce


@pytest.mark.parametrize("module", [pretrain, reinforce])
def test_an_interrupted_training_ends_without_a_traceback(module, monkeypatch, capsys):
    def stopped(*_):
        raise KeyboardInterrupt

    name = module.__name__.rpartition(".")[2]
    monkeypatch.setattr(module, "main", stopped)
    assert learning.run(name, [], Path("configs"), print) == 130
    assert capsys.readouterr().err == f"{name}: interrupted\n"
