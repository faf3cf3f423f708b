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


def place_first(first: viser.InitialCameraConfig) -> None:
    """Each client begins at the corner, with all of the part in sight."""
    first.position, first.look_at, first.up = _eye("Corner"), np.zeros(3), UP


def light(scene: viser.SceneApi) -> None:
    """Two lights in place of the toolkit's picture of a room and its many, which a machine without a graphics card draws slowly."""
    scene.world_axes.visible = False
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere("/lights/sky", ground_color=GROUND, intensity=SKY, position=(0.0, 0.0, 1.0))
    scene.add_light_directional("/lights/key", intensity=KEY, position=(1.5, -3.5, 4.0))


class PageCamera:
    """Looks at the middle of the part, from one of STANDARD_VIEWS, or turning round it.

    It is moved in steps of the server's loop alone (`soon` asks for one): the toolkit moves the point looked at with the eye, and a word
    from the browser that came before that point was put back would leave it there, with nothing in sight.
    """

    def __init__(
        self,
        camera: viser.CameraHandle,
        at_once: Callable[[], AbstractContextManager[object]],
        soon: Callable[[Callable[[], None]], None],
    ) -> None:
        self._camera, self._at_once, self._soon = camera, at_once, soon
        self._turning = threading.Event()

    def look(self, view: str = "Corner") -> None:
        """Put the camera where all of the part is seen, from one of STANDARD_VIEWS."""
        self._soon(lambda: self._move(_eye(view), STANDARD_VIEWS[view][1]))

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
        while not ended.wait(TURN_S):
            self._soon(self._go_round)

    def _go_round(self) -> None:
        c, s = math.cos(math.radians(TURN_DEG)), math.sin(math.radians(TURN_DEG))
        x, y, z = self._camera.position
        self._move(np.array([c * x - s * y, s * x + c * y, z]))

    def _move(self, eye: np.ndarray, up: tuple[float, float, float] | None = None) -> None:
        with self._at_once():
            self._camera.position = eye
            self._camera.look_at = np.zeros(3)
            if up is not None:
                self._camera.up_direction = up


def _eye(view: str) -> np.ndarray:
    place = np.array(STANDARD_VIEWS[view][0])
    return AWAY * place / np.linalg.norm(place)
