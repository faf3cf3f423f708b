"""The target's points in the view: few of them while something moves, the others as soon as it rests."""

from __future__ import annotations

import math
import threading
import time

import numpy as np
import viser

COLOUR = (110, 118, 130)
SIZES, SIZED_FOR = (0.022, 0.01), 8_000  # of a point, alone and beside a solid, where there are so many; more points are smaller
MOVING = 5_000  # without a graphics card each point takes about 4 microseconds of a core in every frame
STILL_S = 0.5  # without motion, after which the others are drawn


class Points:
    """The points of one client's view. Any thread may call its methods."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client, self._lock = client, threading.RLock()
        self._few: viser.PointCloudHandle | None = None
        self._rest: viser.PointCloudHandle | None = None
        self._share, self._beside = 1.0, False
        self._shown, self._still = True, True
        self._moved_at = 0.0

    def draw(self, points: np.ndarray) -> None:
        """Points [n, 3] in place of those before."""
        with self._lock:
            self.forget()
            self._share = max(len(points) / MOVING, 1.0)
            few = np.zeros(len(points), bool)
            few[np.linspace(0, len(points) - 1, min(len(points), MOVING)).astype(int)] = True
            self._few = self._add("/cloud/few", points[few])
            self._rest = None if few.all() else self._add("/cloud/rest", points[~few])
            self._still = True
            self._update()

    def forget(self) -> None:
        """No points."""
        with self._lock:
            for node in (self._few, self._rest):
                if node is not None:
                    node.remove()
            self._few = self._rest = None

    def close(self) -> None:
        """The client has gone: nothing is sent any more."""
        with self._lock:
            self._few = self._rest = None

    def show(self, shown: bool) -> None:
        with self._lock:
            self._shown = shown
            self._update()

    def beside(self, solid: bool) -> None:
        """Whether there is a solid, beside which points are smaller."""
        with self._lock:
            self._beside = solid
            self._update()

    def stir(self) -> None:
        """Something moves or changes: few points until it has been still for STILL_S."""
        self._moved_at = time.monotonic()
        with self._lock:
            if self._rest is None or not self._still:
                return
            self._still = False
            self._update()
        threading.Thread(target=self._settle, name="settle", daemon=True).start()

    def _settle(self) -> None:
        while (left := self._moved_at + STILL_S - time.monotonic()) > 0:
            time.sleep(left)
        with self._lock:
            self._still = True
            self._update()

    def _update(self) -> None:
        """As many points as there are cover the same share of the part."""
        count = MOVING * (self._share if self._still else 1.0)
        size = SIZES[self._beside] * min(1.0, math.sqrt(SIZED_FOR / count))
        with self._client.atomic():
            for node, seen in ((self._few, True), (self._rest, self._still)):
                if node is not None:
                    node.point_size, node.visible = size, self._shown and seen

    def _add(self, name: str, points: np.ndarray) -> viser.PointCloudHandle:
        return self._client.scene.add_point_cloud(name, points, COLOUR, point_size=SIZES[0], point_shape="circle", precision="float32")
