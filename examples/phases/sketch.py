"""Small pictures of clouds and control graphs, with Pillow alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

PANEL, MARGIN, HEADER = 420, 40, 34
VIEW = np.array([[0.78, 0.62, 0.0], [-0.28, 0.35, 0.89]])  # rows: right and up on the picture
FLAT = np.array([[1.0, 0, 0], [0, 1.0, 0]])
CLOUD, EDGE, POINT, ANCHOR, INK = (160, 168, 178), (60, 110, 180), (200, 60, 40), (30, 140, 90), (40, 44, 52)


class Panel:
    """One square drawing; everything is scaled to the extent of `frame` [n, 3]."""

    def __init__(self, title: str, frame: np.ndarray, axes: np.ndarray = FLAT) -> None:
        self.image = Image.new("RGB", (PANEL, PANEL + HEADER), "white")
        self.draw, self.axes = ImageDraw.Draw(self.image), axes
        self.draw.text((12, 10), title, INK)
        flat = frame @ axes.T
        self.center = (flat.min(axis=0) + flat.max(axis=0)) / 2
        self.scale = (PANEL - 2 * MARGIN) / max(float(np.ptp(flat, axis=0).max()), 1e-9)

    def spots(self, points: np.ndarray) -> list[tuple[float, float]]:
        flat = (np.atleast_2d(points) @ self.axes.T - self.center) * self.scale * [1, -1] + [PANEL / 2, PANEL / 2 + HEADER]
        return [(float(x), float(y)) for x, y in flat]

    def dots(self, points: np.ndarray, radius: float, colour: tuple[int, int, int]) -> None:
        for x, y in self.spots(points):
            self.draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=colour)

    def lines(self, points: np.ndarray, pairs: Sequence[tuple[int, int]], colour: tuple[int, int, int] = EDGE, width: int = 2) -> None:
        spots = self.spots(points)
        for a, b in pairs:
            self.draw.line((*spots[a], *spots[b]), fill=colour, width=width)

    def path(self, points: np.ndarray, colour: tuple[int, int, int] = EDGE) -> None:
        self.draw.line(self.spots(points), fill=colour, width=2)


def write(panels: Sequence[Panel], path: Path) -> None:
    """The panels side by side as a PNG."""
    sheet = Image.new("RGB", (PANEL * len(panels), PANEL + HEADER), "white")
    for number, panel in enumerate(panels):
        sheet.paste(panel.image, (number * PANEL, 0))
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.save(path)
