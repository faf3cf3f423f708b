"""What stands on the page reaches the run as it stands there."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from tests.drawn import BORED

from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.resume import Rates
from imdim.program.tree import SIMPLE, leaves, replace_leaves
from imdim.reconstruction.config import LANGUAGES, Settings

viser = pytest.importorskip("viser")
run = pytest.importorskip("imdim.app.lab.panels.run")
edit = pytest.importorskip("imdim.app.lab.panels.edit")
InputQueue = pytest.importorskip("imdim.app.lab.input_queue").InputQueue
GUI = ("add_html", "add_folder", "add_dropdown", "add_number", "add_button_group")


@pytest.fixture(scope="module")
def server():
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield server
    server.stop()


@pytest.fixture
def panel(server):
    queue = InputQueue(server.get_event_loop())
    yield run.RunPanel(server.gui, SimpleNamespace(set_units=None), queue)
    queue.close()


def test_untouched_settings_are_the_defaults(panel):
    plain = Settings()
    named = {"method": plain.method, "language": plain.language, "size_weight": plain.size_weight, "seed": plain.seed}
    assert panel.settings() == {**named, "budget_s": 60.0}
    assert panel.language.options == LANGUAGES
    assert panel.rates() == Rates()


def test_settings_and_rates_are_those_of_the_page(panel):
    panel.method.value, panel.budget.value, panel.price.value, panel.seed.value = "evolve", 12.0, 0.01, 7
    panel.language.value = "csg"
    panel.mutation.value, panel.elitism.value, panel.population.value, panel.tolerance.value = 0.3, 0.9, 128, 0.002
    assert panel.settings() == {"method": "evolve", "language": "csg", "budget_s": 12.0, "size_weight": 0.01, "seed": 7}
    assert panel.rates() == Rates(mutation=0.3, elitism=0.9, population=128, tolerance=0.002)


def test_a_selected_extrusion_shows_its_numbers_and_its_outline(server):
    queue = InputQueue(server.get_event_loop())
    with server.gui.add_tab_group().add_tab("Edit") as tab:
        panel = edit.EditPanel(server.gui, tab, SimpleNamespace(), queue)
    panel._gui = SimpleNamespace(**{name: getattr(server.gui, name) for name in GUI})
    panel.draw(ConstrainedProgram(BORED), 0, "mm")
    inputs = dict(panel._inputs)
    assert [*inputs] == ["h", "x", "y", "z", "turn_x", "turn_y", "turn_z"]
    assert "<svg" in panel._texts["outline"].content
    panel.draw(ConstrainedProgram(replace_leaves(BORED, {0: replace(next(leaves(BORED)), size=(3.0,))})), 0, "mm")
    assert panel._inputs == inputs, "made anew, they would lose what is being typed"
    panel.draw(ConstrainedProgram(BORED), 1, "mm")
    assert [*panel._inputs][:2] == ["r", "h"]
    assert [*panel._texts] == ["heading"]
    assert panel.kind.options == SIMPLE
    queue.close()
