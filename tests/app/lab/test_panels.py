"""What stands on the page reaches the run as it stands there."""

from types import SimpleNamespace

import pytest

from imdim.app.lab.resume import Rates
from imdim.reconstruction.config import Settings

viser = pytest.importorskip("viser")
run = pytest.importorskip("imdim.app.lab.panels.run")
Ear = pytest.importorskip("imdim.app.lab.input_queue").InputQueue


@pytest.fixture(scope="module")
def server():
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield server
    server.stop()


@pytest.fixture
def panel(server):
    ear = Ear(server.get_event_loop())
    yield run.RunPanel(server.gui, SimpleNamespace(), ear)
    ear.close()


def test_untouched_settings_are_the_defaults(panel):
    plain = Settings()
    assert panel.settings() == {"method": plain.method, "budget_s": 60.0, "size_weight": plain.size_weight, "seed": plain.seed}
    assert panel.rates() == Rates()


def test_settings_and_rates_are_those_of_the_page(panel):
    panel.method.value, panel.budget.value, panel.price.value, panel.seed.value = "evolve", 12.0, 0.01, 7
    panel.mutation.value, panel.elitism.value, panel.population.value, panel.tolerance.value = 0.3, 0.9, 128, 0.002
    assert panel.settings() == {"method": "evolve", "budget_s": 12.0, "size_weight": 0.01, "seed": 7}
    assert panel.rates() == Rates(mutation=0.3, elitism=0.9, population=128, tolerance=0.002)
