"""Change the selected primitive: its numbers with units, locks and operation; add and remove primitives; undo and redo; solve."""

from __future__ import annotations

import math

import viser

from imdim.app.lab import edits, renderers
from imdim.app.lab.drawing import names
from imdim.app.lab.edits import ConstrainedProgram, Number
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.outline_picture import draw_outline
from imdim.app.lab.panels.buttons import enable
from imdim.app.lab.session import Session
from imdim.app.lab.solving import Lock
from imdim.app.lab.style import BLUE, GREY, RED
from imdim.program.edges import SIZES_OF, EdgeFeature
from imdim.program.tree import OPS, SIMPLE, SIZE_NAMES, Op, Primitive, envelope, leaves
from imdim.target.target import Frame

NOTHING = "Select a primitive or a rounded edge in the picture, the tree or the code."
LOCKED = "\N{LOCK}"
NEW_SIZE = 0.15  # of the diagonal
EDGE_STEP = 1e-3  # of the sizes of blends, in the unit
DIGITS = 4  # of the part's size that inputs show
FIT = "Fit the numbers to the part"


class EditPanel:
    """See the module."""

    def __init__(
        self,
        gui: viser.GuiApi,
        place: viser.GuiTabHandle,
        session: Session,
        queue: InputQueue,
    ) -> None:
        self._gui, self._place, self._session, self._queue = gui, place, session, queue
        self.unit = ""
        self._shown: tuple[int, str] | None = None
        self._locks: viser.GuiButtonGroupHandle | None = None
        self._operation: viser.GuiDropdownHandle[Op] | None = None
        self._inputs: dict[str, viser.GuiNumberHandle[float]] = {}
        self._texts: dict[str, viser.GuiHtmlHandle] = {}
        self._watched: list[object] = []  # inputs of the selected primitive
        self._numbers = gui.add_folder("Numbers")
        self._order = self._numbers.order
        with self._numbers:
            gui.add_html(renderers.note(NOTHING))
        self.follow = gui.add_checkbox("Keep relations", True, hint="What the constraints relate to an edited number moves along")
        self._undo, self._redo = (gui.add_button(word, color=GREY, disabled=True) for word in ("Undo", "Redo"))
        queue.press(self._undo, lambda _: session.undo())
        queue.press(self._redo, lambda _: session.redo())
        self._solve = gui.add_button(FIT, color=BLUE, hint="Relations hold, and what is locked stays", disabled=True)
        queue.press(self._solve, lambda _: session.solve())
        with gui.add_folder("Add or remove"):
            self.kind = gui.add_dropdown("Kind", SIMPLE, initial_value="cylinder")
            self.op = gui.add_dropdown("Joined by", OPS)
            queue.press(gui.add_button("Add", color=GREY), lambda _: self._add())
            self._remove = gui.add_button("Remove the selected", color=RED, disabled=True)
            queue.press(self._remove, lambda _: self.remove())

    def remove(self) -> None:
        number = self._session.state.selected
        if number is not None:
            self._session.edit("remove", lambda theory: edits.without(theory, number))

    def _add(self) -> None:
        target = self._session.state.target
        if target is None:
            return
        frame = Frame.of(target)
        part = new_primitive(self.kind.value, frame)
        self._session.add(self.op.value, part)

    def draw_state(self) -> None:
        """What the buttons can do now."""
        enable(self._undo, self._session.history.can_undo)
        enable(self._redo, self._session.history.can_redo)

    def draw(self, theory: ConstrainedProgram | None, selected: int | None, unit: str) -> None:
        """The numbers of what is selected, in `unit`; inputs stay while that is the same, so that typing is not disturbed."""
        self.unit = unit
        enable(self._solve, theory is not None)
        enable(self._remove, theory is not None and selected is not None)
        feature = None if theory is None else theory.edge_feature(selected)
        if theory is not None and selected is not None and feature is not None:
            self._draw_edges(theory.edges[feature], feature, selected)
            return
        parts = [] if theory is None else list(leaves(theory.program))
        if theory is None or selected is None or selected >= len(parts):
            if self._shown is not None:
                self._clear(NOTHING)
            self._shown = None
            return
        part, operation = parts[selected], edits.operation(theory.program, selected)
        key = (selected, f"{part.kind} {self.unit} {operation is None} {part.outline is None}")
        if key != self._shown:
            self._build(selected, part, operation)
            self._shown = key
        self._show_text("heading", _heading(selected, part, names(theory)[selected]))
        if part.outline is not None:
            self._show_text("outline", draw_outline(part, self.unit))
        if self._operation is not None and operation is not None:
            self._queue.show(self._operation, operation)
        for number in edits.numbers(part):
            box = self._inputs[number.name]
            self._queue.show(box, number.value, 0.5 * box.step)
        options = tuple(f"{LOCKED if Lock(selected, n) in theory.locks else ''}{n}" for n in _lockable(part))
        if self._locks is not None and tuple(self._locks.options) != options:
            self._locks.options = options

    def _build(self, leaf: int, part: Primitive, operation: Op | None) -> None:
        """Inputs for all numbers of a primitive, its operation and its locks. A name or an operation that changes is written into what is
        there: inputs that are made anew lose what is being typed."""
        self._clear()
        with self._numbers:
            self._texts["heading"] = self._gui.add_html("")
            if operation is not None:
                self._operation = self._gui.add_dropdown("Operation", OPS, initial_value=operation)
                self._queue.watch(self._operation, lambda value: self._operate(leaf, value))
                self._watched.append(self._operation)
            for number in edits.numbers(part):
                self._inputs[number.name] = self._input(leaf, part, number)
            if part.outline is not None:
                self._texts["outline"] = self._gui.add_html("")
            self._locks = self._gui.add_button_group("Lock", tuple(_lockable(part)), hint="A locked number is not moved by the solver")
            self._queue.press(self._locks, lambda value: self._lock(leaf, value.removeprefix(LOCKED)))
            self._watched += [*self._inputs.values(), self._locks]

    def _show_text(self, which: str, text: str) -> None:
        if self._texts[which].content != text:
            self._texts[which].content = text

    def _draw_edges(self, edges: EdgeFeature, feature: int, number: int) -> None:
        """The sizes of a feature of edges."""
        words = SIZES_OF[edges.kind][: len(edges.sizes)]
        key = (number, f"{edges.kind} {len(edges.edges)} {self.unit} {words}")
        if key != self._shown:
            self._clear()
            with self._numbers:
                self._gui.add_html(_edge_heading(edges))
                for which, word in enumerate(words):
                    self._inputs[word] = box = self._gui.add_number(f"{word} {self.unit}".strip(), 0.0, min=0.0, step=EDGE_STEP)
                    self._queue.watch(box, lambda value, which=which: self._resize_edges(feature, which, float(value)))
            self._watched = [*self._inputs.values()]
            self._shown = key
        for word, size in zip(words, edges.sizes, strict=True):
            self._queue.show(self._inputs[word], size, 0.5 * EDGE_STEP)

    def _resize_edges(self, feature: int, which: int, value: float) -> None:
        self._session.edit(f"number edge {feature} {which}", lambda theory: edits.with_edge_size(theory, feature, which, value))

    def _input(self, leaf: int, part: Primitive, number: Number) -> viser.GuiNumberHandle[float]:
        sign = "°" if number.unit == "degrees" else self.unit
        digits = 3 if number.unit == "degrees" else max(0, DIGITS - 1 - math.floor(math.log10(max(*envelope(part).size, 1e-12))))
        least = 0.0 if number.name in SIZE_NAMES[part.kind] else None
        label = f"{number.name} {sign}".strip()
        step, shown = 10.0**-digits, round(number.value, digits) + 0.0
        box = self._gui.add_number(label, float(shown), min=least, step=step)
        self._queue.watch(box, lambda value: self._edit(leaf, number.name, float(value)))
        return box

    def _edit(self, leaf: int, name: str, value: float) -> None:
        follow = self.follow.value
        self._session.edit(f"number {leaf} {name}", lambda theory: edits.with_number(theory, leaf, name, value, follow))

    def _operate(self, leaf: int, op: Op) -> None:
        self._session.edit("operation", lambda theory: edits.with_operation(theory, leaf, op))

    def _lock(self, leaf: int, name: str) -> None:
        lock = Lock(leaf, name)
        self._session.edit("lock", lambda theory: edits.with_lock(theory, lock, lock not in theory.locks))

    def _clear(self, line: str = "") -> None:
        self._numbers.remove()
        with self._place:
            self._numbers = self._gui.add_folder("Numbers", order=self._order)
        self._queue.forget(*self._watched)
        self._operation, self._locks = None, None
        self._inputs, self._texts, self._watched = {}, {}, []
        if line:
            with self._numbers:
                self._gui.add_html(renderers.note(line))


def new_primitive(kind: str, frame: Frame) -> Primitive:
    """One in the middle of the part, as large as a share of it."""
    size = NEW_SIZE / frame.scale
    shares = {"cylinder": (0.5, 2.0), "cone": (0.6, 0.2, 1.0), "torus": (1.0, 0.25), "sphere": (0.6,)}
    return Primitive(kind, tuple(size * s for s in shares.get(kind, (1.0, 1.0, 1.0))), frame.center)


def _lockable(part: Primitive) -> list[str]:
    return list(dict.fromkeys(n.lock for n in edits.numbers(part)))


def _edge_heading(edges: EdgeFeature) -> str:
    many = f"{len(edges.edges)} edge{'s' if len(edges.edges) > 1 else ''}"
    return f'<div style="padding:0 12px 6px;font-size:13px;color:#212529"><b>{edges.kind}</b> of {many}</div>'


def _heading(leaf: int, part: Primitive, name: str) -> str:
    return f'<div style="padding:0 12px 6px;font-size:13px;color:#212529"><b>{leaf} {name}</b>, {part.kind}</div>'
