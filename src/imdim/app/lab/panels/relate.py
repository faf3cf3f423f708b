"""Relations: those there are, whether they hold, new ones, and the search for more."""

from __future__ import annotations

from collections.abc import Callable

import viser

from imdim.app.lab import edits, renderers
from imdim.app.lab.drawing import VIOLATED
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.panels.buttons import enable
from imdim.app.lab.panels.pick import PickPanel
from imdim.app.lab.session import Session
from imdim.app.lab.solving import violations
from imdim.app.lab.style import GREY, RED
from imdim.app.lab.view import SceneView
from imdim.program.constraints import AXES_OF, FACES_OF, LENGTHS_OF, RULES, Constraint
from imdim.program.tree import Primitive, leaves

AMOUNT = "Distance or size"


class RelatePanel:
    """See the module."""

    def __init__(self, gui: viser.GuiApi, session: Session, queue: InputQueue, view: SceneView, changed: Callable[[], None]) -> None:
        self._session, self._queue, self._changed = session, queue, changed
        self._chosen = -1
        with gui.add_folder("Measure and relate"):
            self.picks = PickPanel(gui, session, queue, view, self._choose)
        self._list = gui.add_html("")
        renderers.add_clicks(gui, "Constraint", queue, self._choose)
        self.amount = gui.add_number(AMOUNT, 0.0, min=0.0, step=0.001, hint="Of the relation that was clicked in the list", disabled=True)
        queue.watch(self.amount, lambda value: self._set(float(value)))
        self._off = gui.add_button("Remove the relation", color=RED, hint="The one that was clicked in the list", disabled=True)
        queue.press(self._off, lambda _: self._remove())
        self._look = gui.add_button("Look for relations", color=GREY, disabled=True)
        queue.press(self._look, lambda _: session.relate())
        with gui.add_folder("Write a relation", expand_by_default=False):
            self._hint = gui.add_html("")
            self.kind = gui.add_dropdown("Relation", tuple(RULES), initial_value="equal")
            self.of = gui.add_text("Of", "", hint="Features, as in 2.r, 3.r")
            self.about = gui.add_text("About", "", hint="An axis, as in world.z or 0.z, where the kind needs one")
            self.value = gui.add_number("Value", 0.0, step=0.001)
            self._more = gui.add_button("Add the relation", color=GREY, disabled=True)
            queue.press(self._more, lambda _: self._add())

    def _choose(self, number: int) -> None:
        self._chosen = number
        self._changed()

    def _set(self, amount: float) -> None:
        number = self._chosen
        self._session.edit(f"number relation {number}", lambda theory: edits.with_amount(theory, number, amount))

    def _add(self) -> None:
        def change(theory: ConstrainedProgram) -> ConstrainedProgram:
            constraint = edits.read_constraint(self.kind.value, self.of.value, self.about.value, self.value.value)
            return edits.with_constraint(theory, constraint)

        self._session.edit("constraint", change)

    def _remove(self) -> None:
        number = self._chosen
        if self._session.edit("constraint", lambda theory: edits.without_constraint(theory, number)):
            self._choose(-1)

    def draw(self, theory: ConstrainedProgram | None, selected: int | None, unit: str) -> None:
        """The list, and the features that the selected primitive offers."""
        if theory is None or self._chosen >= len(theory.constraints):
            self._chosen = -1
        off = [] if theory is None else violations(theory.program, theory.constraints)
        self._list.content = renderers.relations(theory, off, VIOLATED, self._chosen, unit)
        self.picks.draw(theory, unit)
        self._draw_amount(None if theory is None or self._chosen < 0 else theory.constraints[self._chosen])
        enable(self._off, self._chosen >= 0)
        enable(self._look, theory is not None)
        enable(self._more, theory is not None)
        parts = [] if theory is None else list(leaves(theory.program))
        text = "Select a primitive to see the names of its features."
        if selected is not None and selected < len(parts):
            text = f"Features of {selected}: {features(selected, parts[selected])}"
        self._hint.content = renderers.note(text)

    def _draw_amount(self, constraint: Constraint | None) -> None:
        """The distance or the size of the relation that is chosen."""
        amount = None if constraint is None else edits.amount_of(constraint)
        if self.amount.disabled != (amount is None):
            self.amount.disabled = amount is None
        if amount is not None:
            self._queue.show(self.amount, amount, 1e-9)


def features(leaf: int, part: Primitive) -> str:
    """What constraints can say of a primitive: sizes, axes, faces, its centre."""
    sizes = [f"{leaf}.{name}" for name in LENGTHS_OF[part.kind]]
    axes = [f"{leaf}.{axis}" for axis in AXES_OF[part.kind]]
    faces = [f"{leaf}.{side}{axis}" for axis in FACES_OF.get(part.kind, ()) for side in "+-"]
    return "; ".join(f"{what} {', '.join(n)}" for what, n in (("sizes", sizes), ("axes", axes), ("faces", faces)) if n) + f"; centre {leaf}"
