"""From where one client looks at the part, and by what light."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager

import numpy as np
import viser

TURN_DEG, TURN_S = 1.0, 0.05
AWAY = 3.56  # of the camera from the middle of the part, all of which it just sees
UP, NORTH = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)
STANDARD_VIEWS: Mapping[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {  # where the camera is, and what is up
    "Corner": ((1.85, -2.45, 1.8), UP),
    "Front": ((0.0, -1.0, 0.0), UP),
    "Top": ((0.0, 0.0, 1.0), NORTH),
    "Right": ((1.0, 0.0, 0.0), UP),
    "Back": ((0.0, 1.0, 0.0), UP),
    "Bottom": ((0.0, 0.0, -1.0), NORTH),
    "Left": ((-1.0, 0.0, 0.0), UP),
}
SKY, KEY, GROUND = 1.9, 1.6, (140, 144, 156)  # intensities, and what comes from below


def light(scene: viser.SceneApi) -> None:
    """Two lights in place of the toolkit's picture of a room and its many, which a machine without a graphics card draws slowly."""
    scene.world_axes.visible = False
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere("/lights/sky", ground_color=GROUND, intensity=SKY, position=(0.0, 0.0, 1.0))
    scene.add_light_directional("/lights/key", intensity=KEY, position=(1.5, -3.5, 4.0))


class PageCamera:
    """Looks at the middle of the part, from one of STANDARD_VIEWS, or turning round it."""

    def __init__(self, camera: viser.CameraHandle, at_once: Callable[[], AbstractContextManager[object]]) -> None:
        self._camera, self._at_once = camera, at_once
        self._turning = threading.Event()
        self.look()

    def look(self, view: str = "Corner") -> None:
        """Put the camera where all of the part is seen, from one of STANDARD_VIEWS."""
        place, up = map(np.array, STANDARD_VIEWS[view])
        self._camera.position, self._camera.look_at, self._camera.up_direction = AWAY * place / np.linalg.norm(place), np.zeros(3), up

    @property
    def position(self) -> np.ndarray:
        """Where it is [3] in the view."""
        return np.array(self._camera.position)

    def turn(self, on: bool) -> None:
        """Let the part turn slowly, or hold it still."""
        self._turning.set()
        if on:
            self._turning = threading.Event()
            threading.Thread(target=self._turn, args=(self._turning,), name="turn", daemon=True).start()

    def close(self) -> None:
        """The client has gone."""
        self.turn(False)

    def _turn(self, ended: threading.Event) -> None:
        c, s = math.cos(math.radians(TURN_DEG)), math.sin(math.radians(TURN_DEG))
        while not ended.wait(TURN_S):
            with self._at_once():
                x, y, z = self._camera.position
                self._camera.position = np.array([c * x - s * y, s * x + c * y, z])
                self._camera.look_at = np.zeros(3)
