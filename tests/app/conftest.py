"""A folder of parts, and what stands in for `imdim fit` on them."""

import pytest
from tests.app.batches import STAND_IN
from tests.stand_ins import stand_in_for


@pytest.fixture
def stand_in(tmp_path):
    return lambda pause=0.0: stand_in_for(tmp_path, STAND_IN, PAUSE=pause)


@pytest.fixture
def parts(tmp_path):
    path = tmp_path / "parts"
    path.mkdir()
    return path
