"""What the part stands on in the view: a grid of round lengths, and at its corner the directions of the axes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import viser

from imdim.app.lab.drawing import SPAN
from imdim.target.target import Frame, Target

CELLS = 12.0  # that the diagonal of a part is at least long
AROUND = 1.25  # times the part: the grid
AXIS = 0.12  # of the diagonal
GRID, TENTH = (226, 230, 234), (206, 212, 218)
AXES = ((201, 42, 42), (43, 138, 62), (24, 100, 171))


@dataclass(frozen=True)
class Ground:
    """A grid in the target's units: its `step`, its `center` [3] on the lowest level of the part, and how many steps it is wide and
    deep."""

    step: float
    center: np.ndarray
    cells: tuple[int, int]

    @staticmethod
    def of(target: Target) -> Ground:
        """The ground of a part."""
        low, high = np.min(target.points, axis=0), np.max(target.points, axis=0)
        diagonal = float(np.linalg.norm(high - low))
        step = 10.0 ** math.floor(math.log10(diagonal / CELLS))
        step *= next(times for times in (5, 2, 1) if times * step <= diagonal / CELLS)
        middle = np.round((low + high) / 2 / step) * step
        wide, deep = (2 * math.ceil(AROUND * extent / step / 2) for extent in (high - low)[:2])
        return Ground(step, np.array([middle[0], middle[1], low[2]]), (wide + 2, deep + 2))

    def draw(self, scene: viser.SceneApi, frame: Frame, visible: bool) -> dict[str, viser.SceneNodeHandle]:
        """The nodes of the grid and of the axes, by their names in the scene."""
        cell = self.step * frame.scale * SPAN
        grid = scene.add_grid(
            "/ground/grid",
            self.cells[0] * cell,
            self.cells[1] * cell,
            cell_size=cell,
            section_size=5 * cell,
            cell_color=GRID,
            section_color=TENTH,
            position=frame.to_unit(self.center) * SPAN,
            fade_strength=0.0,
            shadow_opacity=0.0,
            visible=visible,
        )
        start, length = frame.to_unit(self.center) * SPAN - np.array([*self.cells, 0]) * cell / 2, AXIS * SPAN
        ends = np.stack([np.stack([start, start + length * axis]) for axis in np.eye(3)]).astype(np.float32)
        tints = np.repeat(np.array(AXES, np.uint8)[:, None], 2, axis=1)
        lines = scene.add_line_segments("/ground/axes", ends, tints, thickness=2.0, thickness_units="screen", visible=visible)
        letters = {
            f"/ground/{letter}": scene.add_label(f"/ground/{letter}", letter, position=end[1], anchor="center-center", visible=visible)
            for letter, end in zip("XYZ", ends, strict=True)
        }
        return {"/ground/grid": grid, "/ground/axes": lines, **letters}
