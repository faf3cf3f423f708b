"""The handles of the selected primitive in one client's view, and what dragging them does."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
import viser

from imdim.app.lab import edits
from imdim.app.lab.camera import PageCamera
from imdim.app.lab.drawing import SPAN
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.ground import AXES as TINTS
from imdim.app.lab.handles import Handle, find_handles, measure_drag, nice_step
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.session import Session
from imdim.program.constraints import ConstraintError
from imdim.program.tree import leaves
from imdim.target.target import Frame

ARROW, KNOB = 0.14, 0.075  # of the view: length of a cone, side of a knob
GAP = 0.1  # of the view, between a primitive and its arrows
KNOB_TINT = (240, 140, 0)
STEPS = 200.0  # of the diagonal, that dragging goes by at most
TRIAL = 1e-3  # of the diagonal, by which a size is changed to see how far its face goes
LEAST = 0.25  # of a size's change, that its face goes at least


@dataclass(frozen=True, eq=False)
class _Drag:
    """A handle that is being dragged: where in the view it was grabbed, and how much its number changes for what it moves."""

    leaf: int
    handle: Handle
    grabbed: np.ndarray
    gain: float


class HandleView:
    """See the module. `follows` says whether relations are kept."""

    def __init__(
        self, client: viser.ClientHandle, camera: PageCamera, session: Session, queue: InputQueue, follows: Callable[[], bool]
    ) -> None:
        self._client, self._camera, self._session, self._queue, self._follows = client, camera, session, queue, follows
        self._nodes: dict[str, viser.MeshHandle] = {}
        self._handles: dict[str, Handle] = {}
        self._of: tuple[int, str] | None = None
        self._drag: _Drag | None = None
        self._drags = 0  # so far
        self._lock = threading.RLock()
        self._shown = True

    def show(self, shown: bool) -> None:
        """Whether there are handles."""
        with self._lock:
            self._shown = shown
            for node in self._nodes.values():
                node.visible = shown

    def draw(self, theory: ConstrainedProgram | None, selected: int | None, frame: Frame | None) -> None:
        """The handles of what is selected, where it now is; nodes stay while that is the same, or a drag would end."""
        parts = [] if theory is None else list(leaves(theory.program))
        with self._lock, self._client.atomic():
            if frame is None or selected is None or selected >= len(parts):
                self._clear()
                return
            key = (selected, parts[selected].kind)
            if key != self._of:
                self._clear()
                self._of = key
            self._handles = {h.name: h for h in find_handles(parts[selected], GAP / SPAN / frame.scale)}
            for name, handle in self._handles.items():
                at = frame.to_unit(handle.point) * SPAN
                if name not in self._nodes:
                    self._nodes[name] = self._add(handle, at, selected)
                else:
                    self._nodes[name].position = at

    def _clear(self) -> None:
        for node in self._nodes.values():
            node.remove()
        self._nodes, self._handles, self._of, self._drag = {}, {}, None, None

    def _add(self, handle: Handle, at: np.ndarray, leaf: int) -> viser.MeshHandle:
        shape = trimesh.creation.cone(ARROW / 3, ARROW) if handle.axis is not None else trimesh.creation.box((KNOB, KNOB, KNOB))
        shape.apply_transform(trimesh.geometry.align_vectors((0.0, 0.0, 1.0), handle.direction))
        tint = KNOB_TINT if handle.axis is None else TINTS[handle.axis]
        vertices, faces = np.asarray(shape.vertices, np.float32), np.asarray(shape.faces, np.uint32)
        node = self._client.scene.add_mesh_simple(
            f"/handles/{handle.name}", vertices, faces, color=tint, position=at, flat_shading=True, visible=self._shown
        )
        node.on_drag(self._queue.now(lambda event: self._on_drag(leaf, handle.name, event)))
        return node

    def _on_drag(self, leaf: int, name: str, event: Any) -> None:
        """On the event loop: only what is wanted last is done."""
        if event.phase == "start":
            self._queue.do(lambda: self._grab(leaf, name, np.array(event.start_position)))
            return
        end = np.array(event.end_position)
        self._queue.do_last(f"drag {name}", lambda: self._pull(end))

    def _grab(self, leaf: int, name: str, at: np.ndarray) -> None:
        theory, target = self._session.theory, self._session.state.target
        with self._lock:
            handle = self._handles.get(name)
            self._drags += 1
            if theory is not None and target is not None and handle is not None:
                self._drag = _Drag(leaf, handle, at, self._gain(theory, leaf, handle, TRIAL / Frame.of(target).scale))

    def _gain(self, theory: ConstrainedProgram, leaf: int, handle: Handle, trial: float) -> float:
        """How much the number has to change for its handle to go as far as it is dragged: a face goes half as far as a size where the
        centre stays, and as far where relations hold the other end."""
        try:
            after = edits.with_number(theory, leaf, handle.name, handle.value + trial, self._follows())
        except (edits.LabEditError, ConstraintError):
            return 1.0
        moved = next(h for h in find_handles(list(leaves(after.program))[leaf], 0.0) if h.name == handle.name)
        start = next(h for h in find_handles(list(leaves(theory.program))[leaf], 0.0) if h.name == handle.name)
        went = float((moved.point - start.point) @ handle.direction) / trial
        return 1.0 / went if went > LEAST else 1.0

    def _pull(self, end: np.ndarray) -> None:
        drag, target = self._drag, self._session.state.target
        if drag is None or target is None:
            return
        frame = Frame.of(target)
        far = measure_drag(drag.grabbed, end, drag.handle.direction, self._camera.position) / SPAN / frame.scale
        step = nice_step(1.0 / frame.scale / STEPS)
        value = round((drag.handle.value + drag.gain * far) / step) * step
        value = round(value, max(0, 2 - math.floor(math.log10(step))))
        if drag.handle.axis is None and value <= 0:
            return
        follow = self._follows()
        what = f"drag {self._drags}"  # one step to undo, however long it takes
        self._session.edit(what, lambda theory: edits.with_number(theory, drag.leaf, drag.handle.name, value, follow))
